"""Refusals of ``hsp_step.h`` and their messages."""

from pathlib import Path
from threading import Thread

import numpy as np
import pytest
from frozen_library import (
    BUSY,
    LIB,
    NOT_FINITE,
    OK,
    WRONG_CLOCK,
    WRONG_NAME,
    WRONG_SIZE,
    WRONG_STATE,
    WRONG_VALUE,
    Layout,
    Opened,
    pointer,
    summed,
)

import hsp_control as hsp

SEED = 61


@pytest.fixture(scope="module")
def controller() -> hsp.Controller:
    return hsp.load_experiment("panda_limits").controller


@pytest.fixture(scope="module")
def frozen(
    controller: hsp.Controller, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    return hsp.freeze(controller, tmp_path_factory.mktemp("frozen") / "panda.hsp")


@pytest.fixture
def q(controller: hsp.Controller) -> np.ndarray:
    start = controller._declared.start
    assert start is not None
    return start


# -- files --------------------------------------------------------------------------


def test_no_file(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError, match=r"missing\.hsp: it cannot be read"):
        Opened(tmp_path / "missing.hsp")
    with pytest.raises(
        RuntimeError, match=r"it cannot be read|not a frozen controller"
    ):
        Opened(tmp_path)
    assert LIB.hsp_open(None) is None
    assert b"no file" in LIB.hsp_last_error(None)


@pytest.mark.parametrize("content", [b"", b"hsp", b"robot: {name: panda}\n"])
def test_another_file(content: bytes, tmp_path: Path) -> None:
    other = tmp_path / "other.hsp"
    other.write_bytes(content)
    with pytest.raises(RuntimeError, match="it is not a frozen controller"):
        Opened(other)


def test_a_flipped_byte_and_a_cut_file(frozen: Path, tmp_path: Path) -> None:
    content, changed = frozen.read_bytes(), tmp_path / "changed.hsp"
    rng = np.random.default_rng(SEED)
    for place in (0, 8, 12, len(content) - 1, *rng.integers(len(content), size=100)):
        flipped = bytearray(content)
        flipped[place] ^= 1 << rng.integers(8)
        changed.write_bytes(flipped)
        with pytest.raises(
            RuntimeError, match=r"changed or truncated|not a frozen controller"
        ):
            Opened(changed)
    for length in (8, 11, 12, 13, *rng.integers(len(content), size=30)):
        changed.write_bytes(content[:length])
        with pytest.raises(
            RuntimeError,
            match=r"changed or truncated|not a frozen controller|ends too early",
        ):
            Opened(changed)


@pytest.mark.parametrize("word", [b"hsp_control 0", b"8-byte", b"little"])
def test_another_version_or_processor(
    word: bytes, frozen: Path, tmp_path: Path
) -> None:
    content, other = frozen.read_bytes(), tmp_path / "other.hsp"
    assert word in content
    other.write_bytes(summed(content.replace(word, word[::-1], 1)))
    with pytest.raises(
        RuntimeError, match=r"it was frozen by .*; this library is hsp_"
    ):
        Opened(other)


def test_corrupt_data_with_a_valid_checksum_causes_no_crash(
    frozen: Path, tmp_path: Path
) -> None:
    content, other = frozen.read_bytes(), tmp_path / "other.hsp"
    rng = np.random.default_rng(SEED)
    refused = 0
    for place in rng.integers(90, len(content), size=300):
        changed = bytearray(content)
        changed[place] = rng.integers(256)
        other.write_bytes(summed(bytes(changed)))
        try:
            Opened(other)
        except RuntimeError:
            refused += 1
    assert refused > 30


def test_a_changed_file_that_opens_steps_and_stops(
    frozen: Path, q: np.ndarray, tmp_path: Path
) -> None:
    """Random numbers with a valid checksum: a status is returned, no crash."""
    content, other = frozen.read_bytes(), tmp_path / "other.hsp"
    rng = np.random.default_rng(SEED)
    stepped = 0
    for places in rng.integers(90, len(content), size=(200, 2)):
        changed = bytearray(content)
        for place in places:
            changed[place] = rng.integers(256)
        other.write_bytes(summed(bytes(changed)))
        try:
            opened = Opened(other)
        except RuntimeError:
            continue
        if len(opened.tau) == len(q):
            reported = [opened.step(0.001 * k, q, 0.0 * q) for k in range(3)]
            reported += [opened.stop(0.001 * k, q, 0.0 * q) for k in range(3, 6)]
            assert all(opened.error for status in reported if status < 0)
            stepped += 1
    assert stepped > 20


def test_a_number_has_one_type(frozen: Path, tmp_path: Path) -> None:
    """A value checked as an index is never written as a real number."""
    content, other = bytearray(frozen.read_bytes()), tmp_path / "other.hsp"
    layout = Layout(bytes(content))
    index, real = layout.place("Once", "stamp"), layout.place("JointJacobians", "q")
    content[real : real + 8] = content[index : index + 8]
    other.write_bytes(summed(bytes(content)))
    with pytest.raises(RuntimeError, match="arrays of different types overlap"):
        Opened(other)


def test_a_file_s_numbers_do_not_make_a_step_loop(frozen: Path, tmp_path: Path) -> None:
    """Kinds that may loop forever are those of simulations, not permitted in files."""
    content, other = frozen.read_bytes(), tmp_path / "other.hsp"
    for kind in (b"EqualSteps", b"Periods"):
        named = len(kind).to_bytes(4, "little") + kind
        changed = content.replace(b"\x04\0\0\0Copy", named, 1)
        other.write_bytes(summed(changed))
        with pytest.raises(
            RuntimeError, match=f"of the kind {kind.decode()}, which no"
        ):
            Opened(other)


@pytest.mark.timeout(60)
@pytest.mark.parametrize("times", [0.0, -1e200])
def test_a_stream_whose_times_are_wrong_ends(times: float, tmp_path: Path) -> None:
    robot = hsp.Robot.load("panda")
    hand = hsp.FramePosition("panda_tcp", hsp.Stream(policy="interpolate"))
    declared = hsp.Controller(robot, [hand], start=robot.home())
    file = hsp.freeze(declared, tmp_path / "stream.hsp")
    content, v = bytearray(file.read_bytes()), np.zeros(7)
    layout = Layout(bytes(content))
    for name in ("fades_at", "now"):
        at = layout.array("Stream", name)
        content[at : at + 8] = np.float64(times).tobytes()
    file.write_bytes(summed(bytes(content)))
    opened = Opened(file)
    opened.step(0.0, robot.home(), v)
    assert opened.step(0.001, robot.home(), v) == NOT_FINITE
    assert "not finite" in opened.error


@pytest.mark.timeout(60)
def test_a_message_that_is_taken_at_no_time_ends(tmp_path: Path) -> None:
    robot = hsp.Robot.load("panda")
    hand = hsp.FramePosition("panda_tcp", hsp.Stream())
    declared = hsp.Controller(robot, [hand], start=robot.home())
    file = hsp.freeze(declared, tmp_path / "stream.hsp")
    content, v = bytearray(file.read_bytes()), np.zeros(7)
    layout = Layout(bytes(content))
    at = layout.array("Stream", "queue.count")
    content[at : at + 8] = np.int64(3).tobytes()
    at = layout.array("Stream", "queue.times", rank=2)
    content[at : at + 72] = np.full(9, np.nan).tobytes()
    file.write_bytes(summed(bytes(content)))
    opened = Opened(file)
    for k in range(3):
        opened.step(0.001 * k, robot.home(), v)


@pytest.mark.parametrize("name", ["piece", "taken", "late", "refused"])
def test_a_count_that_could_overflow_is_refused(name: str, tmp_path: Path) -> None:
    robot = hsp.Robot.load("panda")
    hand = hsp.FramePosition("panda_tcp", hsp.Stream())
    declared = hsp.Controller(robot, [hand], start=robot.home())
    file = hsp.freeze(declared, tmp_path / "stream.hsp")
    content = bytearray(file.read_bytes())
    at = Layout(bytes(content)).array("Stream", name)
    content[at : at + 8] = np.int64(2**63 - 1).tobytes()
    file.write_bytes(summed(bytes(content)))
    with pytest.raises(RuntimeError, match=f"{name} has the index {2**63 - 1}"):
        Opened(file)


# -- steps --------------------------------------------------------------------------


def test_a_wrong_state_is_refused_with_the_last_effort(
    opened: Opened, q: np.ndarray
) -> None:
    v = np.zeros(7)
    assert opened.step(0.0, np.full(7, np.nan), v) == WRONG_STATE
    np.testing.assert_array_equal(opened.tau, np.zeros(7))  # there was no effort yet
    assert opened.step(0.0, q, v) == OK
    assert opened.error == ""
    last = opened.tau.copy()
    for t, q_in, v_in in (
        (np.nan, q, v),
        (0.001, q * np.nan, v),
        (0.001, q, v + np.inf),
        (np.inf, q, v),
    ):
        opened.tau[:] = np.nan
        assert opened.step(t, q_in, v_in) == WRONG_STATE
        np.testing.assert_array_equal(opened.tau, last)
        assert "not finite" in opened.error
    assert opened.step(0.001, q, v) == OK


def test_a_clock_that_jumps_is_refused_until_a_restart(
    opened: Opened, q: np.ndarray
) -> None:
    v = np.zeros(7)
    assert opened.step(5.0, q, v) == OK  # a run may begin at any time
    first = opened.tau.copy()
    assert opened.step(5.0, q, v) >= OK
    assert opened.step(5.1, q, v) >= OK
    last = opened.tau.copy()
    for t in (5.0999, 4.0, 5.21, 1e9):
        assert opened.step(t, q, v) == WRONG_CLOCK
        np.testing.assert_array_equal(opened.tau, last)
    assert "hsp_restart" in opened.error
    assert LIB.hsp_restart(opened.handle) == OK
    assert opened.step(5.0, q, v) == OK
    np.testing.assert_array_equal(opened.tau, first)


def test_times_are_relative_to_the_first_step(
    opened: Opened, controller: hsp.Controller, q: np.ndarray
) -> None:
    own, begin = controller.preview(), 1.76e9
    own.restart()
    for k in range(20):
        t, v = begin + 0.001 * k, np.full(7, 0.1)
        output = own.compute(t, q, v)
        own.applied(output.tau, 0.001)
        assert opened.step(t, q, v) == output.status
        np.testing.assert_array_equal(opened.tau, output.tau)
    assert opened.get("origin", 1) == [begin]


def test_null_pointers(opened: Opened, q: np.ndarray) -> None:
    q_in = q.copy()
    given = pointer(q_in), pointer(q_in), pointer(opened.tau)
    for k in range(3):
        some = [None if i == k else each for i, each in enumerate(given)]
        assert LIB.hsp_step(opened.handle, 0.0, *some) == WRONG_VALUE
    assert LIB.hsp_step(None, 0.0, *given) == WRONG_VALUE
    assert LIB.hsp_restart(None) == WRONG_VALUE
    assert LIB.hsp_size_q(None) == LIB.hsp_size_v(None) == 0
    assert not LIB.hsp_port_at(None, 0)
    assert not LIB.hsp_port_of(opened.handle, None)
    assert LIB.hsp_get(opened.handle, None, None, 0) == WRONG_NAME
    LIB.hsp_close(None)


def test_inputs_and_outputs_by_name(
    opened: Opened, controller: hsp.Controller, q: np.ndarray
) -> None:
    ports = opened.ports
    assert {"tau", "acceleration", "status", "hand.error"} <= set(ports)
    error = LIB.hsp_port_of(opened.handle, b"hand.error").contents
    assert (error.size, error.unit, error.is_input) == (3, b"m", 0)
    moved = q + 0.01
    opened.step(0.0, moved, np.zeros(7))
    np.testing.assert_array_equal(opened.get("tau", 7), opened.tau)
    own = controller.preview()
    output = own.compute(0.0, moved, np.zeros(7))
    np.testing.assert_array_equal(opened.get("hand.error", 3), output.task.error)
    np.testing.assert_array_equal(opened.get("status", 1), [output.status])
    np.testing.assert_array_equal(opened.get("acceleration", 7), output.acceleration)
    for name, size, status in (
        ("hand.eror", 3, WRONG_NAME),
        ("hand.error", 2, WRONG_SIZE),
    ):
        with pytest.raises(ValueError, match=f"^{status}$"):
            opened.get(name, size)
        assert opened.error
    assert not LIB.hsp_port_of(opened.handle, b"hand.eror")


def test_two_handles_do_not_know_of_each_other(frozen: Path, q: np.ndarray) -> None:
    one, other = Opened(frozen), Opened(frozen)
    alone = Opened(frozen)
    for k in range(20):
        moved = q + 0.01 * k
        other.step(0.001 * k, -moved, np.ones(7))
        one.step(0.001 * k, moved, np.ones(7))
        alone.step(0.001 * k, moved, np.ones(7))
        np.testing.assert_array_equal(one.tau, alone.tau)


def test_two_threads_in_one_handle_are_reported(opened: Opened, q: np.ndarray) -> None:
    """A concurrent step is refused or complete: ctypes releases the GIL."""
    found: list[int] = []

    def steps() -> None:
        tau, v = np.zeros(7), np.zeros(7)
        for _ in range(20000):
            given = pointer(q), pointer(v), pointer(tau)
            found.append(LIB.hsp_step(opened.handle, 0.0, *given))

    threads = [Thread(target=steps) for _ in range(2)]
    for each in threads:
        each.start()
    for each in threads:
        each.join()
    assert {OK} <= set(found) <= {OK, BUSY}
    assert b"another thread" in LIB.hsp_status_text(BUSY)
