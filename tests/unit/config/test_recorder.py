"""A user's loop is recorded in a log that all commands read."""

from asyncio import CancelledError
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from odd_errors import NamelessError
from robot_cases import load

import hsp_control as hsp
from hsp_control.common.errors import ConfigError, LogError
from hsp_control.simulation.journal import JournalWriter
from hsp_control.simulation.log_writer import LogWriter

PERIOD = 1e-3


def law(field: hsp.NullSpaceField) -> hsp.Controller:
    hand = hsp.FramePosition(name="hand", gains=hsp.Gains(natural_frequency=20.0))
    return hsp.Controller(load("panda"), [hand], field, null_space_gain=8.0)


def run(controller: hsp.Controller, recorder: hsp.Recorder, steps: int) -> None:
    """Hold each effort for a period, while the hand moves away."""
    robot = controller.robot
    q, v = robot.home(), np.zeros(robot.nv)
    there = robot.state(0.0, q, v).position(robot.end_effector) + 0.03
    for k in range(steps):
        output = controller.compute(PERIOD * k, q, v)
        recorder.record(output)
        controller.applied(output.tau, PERIOD)
        if k == 50:
            controller.set_target("hand", there)
            controller.at(0.05).null_space_gain(20.0)
        v = v + PERIOD * robot.forward_dynamics(q, v, output.tau)
        q = robot.integrate(q, PERIOD * v)


def test_a_recorded_loop_is_repeated(tmp_path: Path) -> None:
    path, controller = tmp_path / "logs" / "mine.npz", law(hsp.JointCentering())
    with hsp.Recorder(controller, path) as recorder:
        run(controller, recorder, 501)
        with pytest.raises(LogError, match="still records: close it first"):
            _ = recorder.rollout
    assert [each.name for each in path.parent.iterdir()] == ["mine.npz"]
    log = hsp.Rollout.load(path)
    np.testing.assert_allclose(log.t, np.linspace(0.0, 0.5, 51), atol=1e-12)
    again = hsp.load_experiment(path).run()
    np.testing.assert_allclose(again.t, log.t)
    # Only the integrator differs.
    for name in ("q", "task.hand.reference", "task.hand.error"):
        np.testing.assert_allclose(again[name], log[name], atol=2e-3)
    home = controller.robot.home()
    output = controller.compute(0.501, home, np.zeros(len(home)))
    with pytest.raises(LogError, match="the recorder is closed"):
        recorder.record(output)


def test_a_recorder_that_begins_later_repeats_its_part(tmp_path: Path) -> None:
    """The circle is relative to the controller's start, in place and in time."""
    path, robot = tmp_path / "part.npz", load("panda")
    hand = hsp.FramePosition(name="hand", trajectory=hsp.Circle(0.05, 3.0), blend=0.01)
    controller = hsp.Controller(robot, [hand], hsp.JointCentering())
    q, v = robot.home(), np.zeros(robot.nv)
    with hsp.Recorder(controller, path) as recorder:
        for k in range(101):
            output = controller.compute(5.0 + PERIOD * k, q, v)
            if k >= 50:
                recorder.record(output)
            controller.applied(output.tau, PERIOD)
            v = v + PERIOD * robot.forward_dynamics(q, v, output.tau)
            q = robot.integrate(q, PERIOD * v)
    log, again = hsp.Rollout.load(path), hsp.load_experiment(path).run()
    np.testing.assert_allclose(again.t, np.linspace(0.05, 0.1, 6), atol=1e-12)
    np.testing.assert_allclose(log.t, again.t, atol=1e-12)
    np.testing.assert_allclose(
        again["task.hand.reference"], log["task.hand.reference"], atol=1e-9
    )
    np.testing.assert_allclose(again.q, log.q, atol=2e-3)


def test_an_error_that_names_a_file_of_another_encoding_keeps_its_log(
    tmp_path: Path,
) -> None:
    """Its bytes are lone surrogates, which UTF-8 does not have."""
    path, controller = tmp_path / "mine.npz", law(hsp.JointCentering())
    message = b"no column in caf\xe9.csv".decode(errors="surrogateescape")
    with suppress(ValueError), hsp.Recorder(controller, path) as recorder:
        run(controller, recorder, 2)
        raise ValueError(message)
    assert hsp.Rollout.load(path).meta["message"].endswith(message)


def test_sent_efforts_and_their_durations_are_recorded(
    tmp_path: Path,
) -> None:
    """A row every five periods; the robot received half of each effort."""
    path, controller = tmp_path / "sent.npz", law(hsp.JointCentering())
    q, v, efforts = controller.robot.home(), np.zeros(7), []
    with hsp.Recorder(controller, path, log_period=5 * PERIOD) as recorder:
        for k in range(21):
            output = controller.compute(PERIOD * k, q, v)
            efforts.append(0.5 * output.tau)
            recorder.record(output, 0.5 * output.tau)
    log = hsp.Rollout.load(path)
    np.testing.assert_array_equal(log.tau, efforts[::5])
    assert log.config is not None
    simulation = log.config["simulation"]
    assert simulation["control_period"] == pytest.approx(PERIOD)
    assert simulation["log_period"] == 5 * PERIOD
    assert simulation["duration"] == 4 * 5 * PERIOD


@pytest.mark.parametrize(("log_period", "held"), [
    (5 * PERIOD, PERIOD), (2.5 * PERIOD, None), (0.1 * PERIOD, None)
])  # fmt: skip
def test_how_long_efforts_were_held_is_logged_where_rows_have_whole_periods(
    log_period: float, held: float | None, tmp_path: Path
) -> None:
    controller = law(hsp.JointCentering())
    q, v = controller.robot.home(), np.zeros(7)
    path = tmp_path / "rows.npz"
    with hsp.Recorder(controller, path, log_period=log_period) as recorder:
        for k in range(11):
            recorder.record(controller.compute(PERIOD * k, q, v))
    config = hsp.Rollout.load(path).config
    assert config is not None
    assert config["simulation"]["control_period"] == (held and pytest.approx(held))


def test_a_late_row_does_not_delay_those_after_it() -> None:
    """Rows are due every 2.5 periods, and written at the next period."""
    controller = law(hsp.JointCentering())
    q, v = controller.robot.home(), np.zeros(7)
    with hsp.Recorder(controller, log_period=2.5 * PERIOD) as recorder:
        for k in range(11):
            recorder.record(controller.compute(PERIOD * k, q, v))
    rows = np.array([0, 3, 5, 8, 10])
    np.testing.assert_array_equal(recorder.rollout.t, PERIOD * rows)


def test_an_unrepeatable_run_gives_the_reason_and_an_error_ends_the_log(
    tmp_path: Path,
) -> None:
    path, controller = tmp_path / "mine.npz", law(hsp.FunctionCost(lambda s: s.q[0]))
    recorder = hsp.Recorder(controller, path)
    with suppress(ZeroDivisionError), recorder:
        run(controller, recorder, 30)
        _ = 1 / 0
    assert recorder.rollout.status == "stopped"
    assert recorder.rollout.meta["message"] == "ZeroDivisionError: division by zero"
    with pytest.raises(ConfigError, match=r"configuration: field\.0"):
        hsp.load_experiment(path)
    empty = hsp.Recorder(controller)
    with pytest.raises(LogError, match="nothing was recorded"):
        empty.close()
    with pytest.raises(LogError, match="log_period is 0 s; must be positive"):
        hsp.Recorder(controller, log_period=0)


@pytest.mark.parametrize("rows", [0, 1])
@pytest.mark.parametrize(
    "error",
    [
        ValueError("mine"),
        CancelledError(),
        GeneratorExit(),
        SystemExit(1),
        NamelessError(),
    ],
    ids=lambda error: (
        type(error).__name__ if isinstance(error, BaseException) else None
    ),
)  # fmt: skip
def test_after_any_exception_the_next_recorder_can_write(
    error: BaseException, rows: int, tmp_path: Path
) -> None:
    path, controller = tmp_path / "mine.npz", law(hsp.JointCentering())
    first = hsp.Recorder(controller, path)

    def loop() -> None:
        with first:
            run(controller, first, rows)
            raise error

    with pytest.raises(type(error)) as raised:
        loop()
    assert raised.value is error
    left = [each.name for each in tmp_path.iterdir()]
    assert left == (["mine.npz"] if rows else [])
    again = law(hsp.JointCentering())
    with hsp.Recorder(again, path) as second:
        run(again, second, 30)
    assert hsp.Rollout.load(path).status == "completed"
    if rows:
        assert first.rollout.status == "stopped"


def test_an_unclosed_recorder_is_named_until_it_is_freed(
    tmp_path: Path,
) -> None:
    path, controller = tmp_path / "mine.npz", law(hsp.JointCentering())
    open_one = hsp.Recorder(controller, path)
    with pytest.raises(LogError, match="this program writes it already: close that"):
        hsp.Recorder(controller, path)
    del open_one
    with hsp.Recorder(controller, path) as recorder:
        run(controller, recorder, 30)


def test_a_recorder_in_memory_leaves_no_folder_after_an_error() -> None:
    recorder = hsp.Recorder(law(hsp.JointCentering()))
    assert recorder.journal.exists()
    with pytest.raises(ValueError, match="early"), recorder:
        raise ValueError("early")
    assert not recorder.journal.parent.exists()


def test_a_log_whose_end_cannot_be_written_is_closed_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    controller = law(hsp.JointCentering())
    recorder = hsp.Recorder(controller, tmp_path / "mine.npz")
    run(controller, recorder, 3)

    def full(*_: object) -> None:
        raise LogError("the disk is full")

    monkeypatch.setattr(LogWriter, "end", full)
    with pytest.raises(LogError, match="the disk is full"):
        recorder.close()
    JournalWriter(recorder.journal).close()
