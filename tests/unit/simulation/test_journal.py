"""The journal of a log: all complete rows can be read, however its writer ends."""

import fcntl
import os
import shutil
import signal
import subprocess
import sys
import time
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from live_rigs import PERIOD, Rig, law, start, watched

from hsp_control import Rollout, load_experiment, simulate
from hsp_control.cli import main
from hsp_control.common.errors import LogError
from hsp_control.live import (
    LiveSettings,
    LoopReport,
    Phase,
    StopSettings,
    run_loop,
)
from hsp_control.simulation import journal
from hsp_control.simulation.journal import (
    KILLED,
    MAGIC,
    JournalReader,
    JournalWriter,
    is_journal,
)
from hsp_control.tasks import JointPosture

SMALL = {
    "robot": {"name": "planar3r"},
    "tasks": {
        "tip": {"type": "frame_position", "axes": "xy", "trajectory": {"type": "hold"}}
    },
    "simulation": {"duration": 0.1},
}
PAIR = {"t": (), "q": (2,)}


def whole(path: Path) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    reader = JournalReader(path)
    reader.read()
    return reader.rows(0), reader.meta


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> tuple[Rollout, bytes]:
    """Return a run, and the journal that it wrote."""
    path = tmp_path_factory.mktemp("run") / "a.journal"
    return load_experiment(SMALL).run(log=path), path.read_bytes()


def test_it_is_the_log_that_was_written(
    run: tuple[Rollout, bytes], tmp_path: Path
) -> None:
    rollout, data = run
    (tmp_path / "a.journal").write_bytes(data)
    read = Rollout.load(tmp_path / "a.journal")
    assert read.meta == rollout.meta
    assert list(read.columns) == list(rollout.columns)
    for name, column in rollout.columns.items():
        np.testing.assert_array_equal(read[name], column)
    # It can be saved as any other log.
    kept = Rollout.load(read.save(tmp_path / "a.npz"))
    np.testing.assert_array_equal(kept.q, rollout.q)


def test_cut_anywhere_all_whole_rows_before_are_there(
    run: tuple[Rollout, bytes], tmp_path: Path
) -> None:
    rollout, data = run
    cut = tmp_path / "cut.journal"
    seen = []
    row = sum(a[0].nbytes for a in rollout.columns.values()) + 9
    end = len(data) - len(data) % 7
    for size in range(len(data), end - 3 * row, -7):
        cut.write_bytes(data[:size])
        read = Rollout.load(cut)
        count = len(read)
        seen.append(count)
        np.testing.assert_array_equal(read.q, rollout.q[:count])
        expected = "completed" if size == len(data) else "interrupted"
        assert read.status == expected
        if expected == "interrupted":
            assert read.meta["message"] == KILLED
    # The end's frame first, then rows one by one, none early.
    assert seen[0] == len(rollout)
    assert set(np.diff(seen)) <= {0, -1}
    assert seen[-1] <= len(rollout) - 2


def test_columns_that_come_during_a_run_are_empty_before(tmp_path: Path) -> None:
    """Also if the writer was killed before the first row with them."""
    controller, path = law(), tmp_path / "a.journal"
    controller.at(0.03).add(JointPosture(start(), priority=2, name="posture"))
    run = simulate(controller, start(), duration=0.06, control_period=0.01, log=path)
    read = Rollout.load(path)
    assert read.columns.keys() == run.columns.keys()
    for name, column in run.columns.items():
        np.testing.assert_array_equal(read[name], column)
    error = run["task.posture.error"]
    np.testing.assert_array_equal(np.isnan(error).all(axis=1), run.t < 0.035)
    assert np.isnan(run["singular_values"][0]).sum() == 4
    data = path.read_bytes()
    heading = data.rindex(b'{"columns"')
    length = int.from_bytes(data[heading - 8 : heading - 4], "little")
    path.write_bytes(data[: heading + length])
    cut = Rollout.load(path)
    assert 0 < len(cut) < 7
    assert np.isnan(cut["task.posture.error"]).all()


@given(data=st.data())
def test_a_changed_byte_spoils_one_row_and_no_other(data: st.DataObject) -> None:
    path = Path(os.environ.get("TMPDIR", "/tmp")) / f"spoilt-{os.getpid()}.journal"
    try:
        writer = JournalWriter(path)
        writer.write_heading({"a": (2,)}, {"note": "ä"})
        rows = np.arange(12.0).reshape(6, 2)
        for row in rows:
            writer.write_row(row)
        writer.close()
        written = path.read_bytes()
        frame = 9 + 16
        first = len(written) - 6 * frame
        at = data.draw(st.integers(first, len(written) - 1))
        spoilt = bytearray(written)
        spoilt[at] ^= 1 << data.draw(st.integers(0, 7))
        path.write_bytes(bytes(spoilt))
        reader = JournalReader(path)
        reader.read()
        spoilt_row = (at - first) // frame
        left = np.delete(rows, spoilt_row, axis=0)
        np.testing.assert_array_equal(reader.rows(0)["a"], left)
        assert reader.meta["note"] == "ä"
        # At the end of the file it may be a row in progress.
        assert reader.damaged == (spoilt_row < 5)
    finally:
        path.unlink(missing_ok=True)


def test_continuous_joints_are_unwound(tmp_path: Path) -> None:
    writer = JournalWriter(tmp_path / "a.journal")
    turning = np.linspace(0.0, 9.0, 40)
    wound = np.angle(np.exp(1j * turning))
    shapes = {"t": (), "q": (2,), "v": (1,), "tau": (1,), "joint_positions": (1,)}
    meta = {
        "format": "hsp_control rollout 1",
        "columns": {name: {"unit": "-", "meaning": ""} for name in shapes},
        "robot": {"name": "wheel", "nq": 2, "nv": 1, "dofs": ["turn"],
                  "units": ["rad"], "skeleton_parents": [-1], "continuous": [0]},
    }  # fmt: skip
    writer.write_heading(shapes, meta)
    for t, angle in zip(turning, wound, strict=True):
        writer.write_row(np.array([t, 0, 0, 0, 0, angle]))
    writer.close()
    read = Rollout.load(tmp_path / "a.journal")
    np.testing.assert_allclose(read["joint_positions"][:, 0], turning, atol=1e-12)


@pytest.mark.parametrize("share", [0.3, 0.5, 0.8])
def test_a_damaged_row_is_reported(
    share: float, run: tuple[Rollout, bytes], tmp_path: Path
) -> None:
    rollout, data = run
    spoilt = bytearray(data)
    places, at = [], len(MAGIC)
    while at < len(data):
        if data[at : at + 1] == b"R":
            places.append(at)
        at += 9 + int.from_bytes(data[at + 1 : at + 5], "little")
    spoilt[places[int(share * len(places))] + 60] ^= 8
    path = tmp_path / "a.journal"
    path.write_bytes(bytes(spoilt))
    read = Rollout.load(path)
    assert read.status == rollout.status
    assert read.meta["message"] == "1 damaged row of the journal is left out"
    assert len(read) == len(rollout) - 1
    assert set(read.t) < set(rollout.t)


def test_a_damaged_end_is_reported_but_not_an_unfinished_row(
    run: tuple[Rollout, bytes], tmp_path: Path
) -> None:
    rollout, data = run
    path = tmp_path / "a.journal"
    for spoilt, damaged in ((data[:-1] + b"?", True), (data[:-1], False)):
        path.write_bytes(spoilt)
        read = Rollout.load(path)
        assert read.status == "interrupted"
        assert len(read) == len(rollout)
        assert read.meta.get("damaged", 0) == damaged


@pytest.mark.parametrize("share", [0.0, 0.25, 0.75])
@pytest.mark.parametrize("copy", [0, 1])
def test_the_first_heading_is_read_from_its_copy(
    copy: int, share: float, run: tuple[Rollout, bytes], tmp_path: Path
) -> None:
    """Wherever a byte of one of the two changes, also in its kind and its length."""
    rollout, data = run
    size = 9 + int.from_bytes(data[len(MAGIC) + 1 : len(MAGIC) + 5], "little")
    begin = len(MAGIC) + copy * size
    for at in (begin, begin + 1, begin + 4, begin + 6, begin + 9 + int(share * size)):
        spoilt = bytearray(data)
        spoilt[at] ^= 4
        path = tmp_path / "a.journal"
        path.write_bytes(spoilt)
        read = Rollout.load(path)
        assert read.meta == rollout.meta
        np.testing.assert_array_equal(read.q, rollout.q)
    # A journal without the copy, as it once was.
    path.write_bytes(data[: len(MAGIC)] + data[len(MAGIC) + size :])
    assert Rollout.load(path).meta == rollout.meta


def test_a_heading_that_is_lost_takes_its_rows_and_no_others(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    writer = JournalWriter(path)
    writer.write_heading({"a": ()}, {"x": 1})
    writer.write_row(np.zeros(1))
    begin = path.stat().st_size
    writer.write_heading({"a": (), "b": (2,)}, {"x": 2})
    writer.write_row(np.zeros(3))
    writer.write_end("completed", "")
    writer.close()
    data = bytearray(path.read_bytes())
    data[begin + 30] ^= 1
    path.write_bytes(bytes(data))
    reader = JournalReader(path)
    assert (reader.read(), reader.damaged, reader.ended) == (1, 2, True)


DEEP = b'{"meta": ' + b"[" * 200_000 + b"]" * 200_000 + b"}"
HEADINGS: dict[str, tuple[bytes, str]] = {
    "no JSON": (b"{", "a heading of the journal is invalid"),
    "a list": (b"[]", "a heading of the journal is invalid"),
    "no columns": (b'{"meta": {}}', "a heading of the journal is invalid"),
    "nested": (DEEP, "a heading of the journal is invalid"),
    "of 51 TiB": (
        b'{"meta": {}, "columns": {"a": [7000000000000]}}',
        "a row would have",
    ),
    "of 80 axes": (
        b'{"meta": {}, "columns": {"a": [' + b"1, " * 79 + b"1]}}",
        "a heading of the journal is invalid",
    ),
    "negative": (b'{"meta": {}, "columns": {"a": [-1]}}', "a heading of the journal"),
    "no sizes": (b'{"meta": {}, "columns": {"a": ["x"]}}', "a heading of the journal"),
}


@pytest.mark.parametrize("kind", HEADINGS)
def test_a_heading_that_is_none_is_one_message(kind: str, tmp_path: Path) -> None:
    payload, message = HEADINGS[kind]
    check = zlib.crc32(payload, zlib.crc32(b"H"))
    path = tmp_path / "a.journal"
    head = b"H" + len(payload).to_bytes(4, "little") + check.to_bytes(4, "little")
    path.write_bytes(MAGIC + head + payload)
    with pytest.raises(LogError, match=f"a.journal: {message}"):
        Rollout.load(path)


def test_a_folder_that_is_deleted_meanwhile_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "out" / "a.journal"
    writer = JournalWriter(path)
    writer.write_heading({"a": ()}, {})
    writer.write_row(np.zeros(1))
    shutil.rmtree(path.parent)
    writer.write_row(np.ones(1))
    writer.write_end("completed", "")
    writer.close()
    reader = JournalReader(path)
    assert (reader.read(), reader.ended) == (2, True)


def test_an_invalid_journal_is_reported(
    run: tuple[Rollout, bytes], tmp_path: Path
) -> None:
    empty = tmp_path / "empty.journal"
    empty.write_bytes(MAGIC)
    with pytest.raises(LogError, match="ends before its first heading"):
        Rollout.load(empty)
    other = run[0].save(tmp_path / "b.npz")
    assert not is_journal(other)
    with pytest.raises(LogError, match="is not a journal"):
        JournalReader(other).read()
    with pytest.raises(LogError, match="cannot write the journal"):
        JournalWriter(empty / "below")
    with pytest.raises(LogError, match="no such file"):
        Rollout.load(tmp_path / "none.journal")


# --- while it grows ------------------------------------------------------------------


def test_rows_come_as_they_are_written(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    reader = JournalReader(path, most=100)
    assert reader.read() == 0  # does not exist yet
    writer = JournalWriter(path)
    assert reader.read() == 0
    writer.write_heading(PAIR, {"status": "running", "name": "a"})
    with pytest.raises(LogError, match="this program writes it already"):
        JournalWriter(path)
    for k in range(3):
        writer.write_row(np.array([0.1 * k, k, k]))
        assert reader.read() == 1
    assert reader.meta["name"] == "a"
    assert not reader.ended
    np.testing.assert_allclose(reader.rows(0)["t"], [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(reader.rows(1)["q"], [[1.0, 1.0], [2.0, 2.0]])
    assert reader.rows(3)["q"].shape == (0, 2)
    writer.write_heading({"t": (), "q": (4,)}, {"status": "running"})
    for k in (3, 4):
        writer.write_row(np.full(5, float(k)))
    writer.write_end("completed", "the duration is over")
    assert reader.read() == 2
    assert reader.count == 5
    np.testing.assert_array_equal(reader.rows(3)["q"], [[3.0] * 4, [4.0] * 4])
    assert reader.ended
    assert reader.meta["message"] == "the duration is over"
    writer.close()
    few = JournalReader(path, most=1)
    assert few.read() == 5
    np.testing.assert_array_equal(few.rows(0)["t"], [4.0])  # as far as they are kept


@settings(max_examples=30, deadline=None)
@given(cuts=st.lists(st.integers(0, 2000), max_size=8))
def test_a_frame_that_is_half_written_waits(
    tmp_path_factory: pytest.TempPathFactory, cuts: list[int]
) -> None:
    folder = tmp_path_factory.mktemp("growing")
    writer = JournalWriter(folder / "whole")
    writer.write_heading(PAIR, {"status": "running"})
    for k in range(10):
        writer.write_row(np.full(3, float(k)))
    writer.write_end("completed", "")
    writer.close()
    data = (folder / "whole").read_bytes()
    growing, reader = folder / "growing", JournalReader(folder / "growing")
    found = 0
    for cut in sorted({*(min(c, len(data)) for c in cuts), len(data)}):
        growing.write_bytes(data[:cut])
        found += reader.read()
    assert found == 10
    expected, meta = whole(folder / "whole")
    np.testing.assert_array_equal(reader.rows(0)["q"], expected["q"])
    assert reader.meta == meta


# --- a writer that is cut short ------------------------------------------------------


def test_a_disk_that_is_full_for_a_moment_leaves_a_whole_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A partial frame is removed, so that the end can still be written."""
    path, write = tmp_path / "a.journal", os.write

    def full(file: int, data: bytes) -> int:
        if 1_000 > len(data) > 900:
            write(file, data[:100])
            raise OSError(28, "No space left on device")
        return write(file, data)

    monkeypatch.setattr(journal.os, "write", full)
    writer = JournalWriter(path)
    writer.write_heading({"a": ()}, {"note": 1})
    writer.write_row(np.ones(1))
    with pytest.raises(LogError, match=r"a.journal: .*No space left"):
        writer.write_heading({"a": ()}, {"note": "x" * 930})
    writer.write_end("stopped", "the disk is full")
    writer.close()
    columns, meta = whole(path)
    assert meta == {"note": 1, "status": "stopped", "message": "the disk is full"}
    np.testing.assert_array_equal(columns["a"], [1.0])


class Interrupting:
    """`os.write` interrupted once, before, within or after a row.

    Attributes:
        cut: Number of bytes that are written before; None: all.
    """

    def __init__(self, cut: int | None, at: int) -> None:
        self.cut, self.at, self.calls = cut, at, 0
        self.write = os.write

    def __call__(self, file: int, data: bytes) -> int:
        self.calls += 1
        if self.calls != self.at:
            return self.write(file, data)
        self.write(file, data[: self.cut])
        raise KeyboardInterrupt


def brief_loop(log: Path) -> LoopReport:
    quick = LiveSettings(stop=StopSettings(hold=0.02))
    options: Any = {"duration": 0.06, "log_period": PERIOD, "settings": quick}
    return run_loop(law(), Rig(watched(quick)), log=log, **options)


@pytest.fixture(scope="module")
def brief(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, int]:
    """Return the journal of a loop, and the number of its writes."""
    path, counted = (
        tmp_path_factory.mktemp("brief") / "a.journal",
        Interrupting(None, 0),
    )
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(journal.os, "write", counted)
        assert brief_loop(path).ended == "completed"
    return path, counted.calls


@pytest.mark.system
@pytest.mark.parametrize("cut", [0, 5, 200, None])
@pytest.mark.parametrize("row", [20, -1])
def test_ctrl_c_within_a_row_loses_none(
    cut: int | None,
    row: int,
    brief: tuple[Path, int],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Also within the end of the journal, which is its last frame."""
    path, calls = brief
    at = row if row > 0 else calls
    monkeypatch.setattr(journal.os, "write", Interrupting(cut, at))
    report = brief_loop(tmp_path / "cut.journal")
    monkeypatch.undo()
    read, reference = Rollout.load(tmp_path / "cut.journal"), Rollout.load(path)
    if row > 0:
        assert report.ended == "operator"
        assert read.status == "interrupted"
        assert read["live.phase"][row - 4] == Phase.RUNNING  # magic, headings, rows
    else:
        assert report.ended == read.status == "completed"
        assert len(read) == len(reference)
    np.testing.assert_allclose(np.diff(read.t), PERIOD, rtol=1e-6)  # none is missing
    count = row - 2 if row > 0 else len(read)
    np.testing.assert_array_equal(read.q[:count], reference.q[:count])


@pytest.mark.system
@pytest.mark.slow
def test_the_journal_of_a_killed_run_is_a_log_for_all_commands(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    options = ["--out", str(tmp_path), "--set", "simulation.duration=1000"]
    process = subprocess.Popen(
        [sys.executable, "-m", "hsp_control", "run", "paper/2_rest", *options],
        stderr=subprocess.DEVNULL,
    )
    path = tmp_path / "2_rest-simulation.duration=1000.journal"
    end = time.monotonic() + 200
    try:
        while not (path.exists() and path.stat().st_size > 100_000):
            assert time.monotonic() < end
            time.sleep(0.05)
    finally:
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    read = Rollout.load(path)
    assert read.status == "interrupted"
    assert len(read) > 50
    assert main(["plot", str(path), "--out", str(tmp_path)]) == 0
    assert path.with_name(f"{path.stem}-paper.png").is_file()
    assert main(["check", str(path)]) == 0
    capsys.readouterr()
    # Without a kill only an `.npz` remains.
    short = ["--out", str(tmp_path), "--set", "simulation.duration=0.02"]
    assert main(["run", "paper/2_rest", *short]) == 0
    assert len(list(tmp_path.glob("*.journal"))) == 1
    with np.load(tmp_path / "2_rest-simulation.duration=0.02.npz") as log:
        assert len(log["t"]) == 3
    capsys.readouterr()


@pytest.mark.parametrize("torn", [b"", b"N", b"N\x09\x00\x00\x00....{}"])
def test_it_goes_on_after_a_torn_frame(torn: bytes, tmp_path: Path) -> None:
    for begun in range(3):  # there is none the first time
        reader = JournalReader(tmp_path / "a.journal")
        writer = JournalWriter(reader.path, reader)
        assert reader.notes == [{"k": k} for k in range(begun)]
        writer.write_note({"k": begun})
        writer.close()
        reader.path.write_bytes(reader.path.read_bytes() + torn)
    with pytest.raises(LogError, match="the journal is a sweep's"):
        Rollout.load(reader.path)


def test_a_journal_that_another_process_writes_is_not_said_to_be_ours(
    tmp_path: Path,
) -> None:
    path = tmp_path / "a.journal"
    ours = JournalWriter(path)
    with pytest.raises(LogError, match="this program writes it already"):
        JournalWriter(path)
    ours.close()
    with path.open("r+b") as theirs:
        fcntl.flock(theirs, fcntl.LOCK_EX)
        with pytest.raises(LogError, match="another process writes it"):
            JournalWriter(path)
    JournalWriter(path).close()
