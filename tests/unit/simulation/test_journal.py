"""The journal of a log: whatever ends its writer, all whole rows can be read."""

import os
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hsp_control import Rollout, load_experiment
from hsp_control.cli import main
from hsp_control.common.exceptions import LogError
from hsp_control.simulation.journal import (
    KILLED,
    MAGIC,
    JournalWriter,
    is_journal,
    read_journal,
)

SMALL = {
    "robot": {"name": "planar3r"},
    "tasks": {
        "tip": {"type": "frame_position", "axes": "xy", "trajectory": {"type": "hold"}}
    },
    "simulation": {"duration": 0.1},
}


@pytest.fixture(scope="module")
def rollout() -> Rollout:
    return load_experiment(SMALL).run()


def write(path: Path, rollout: Rollout, *, end: bool = True) -> Path:
    journal = JournalWriter(path)
    journal.write_heading(rollout.columns, rollout.meta)
    for i in range(len(rollout)):
        journal.write_row({name: a[i : i + 1] for name, a in rollout.columns.items()})
    if end:
        journal.write_end("completed", "")
    journal.close()
    return path


def test_it_is_the_log_that_was_written(rollout: Rollout, tmp_path: Path) -> None:
    read = Rollout.load(write(tmp_path / "a.journal", rollout))
    assert read.meta == rollout.meta
    assert read.columns.keys() == rollout.columns.keys()
    for name, column in rollout.columns.items():
        np.testing.assert_array_equal(read[name], column)
    # And it can be kept as every other log is.
    kept = Rollout.load(read.save(tmp_path / "a.npz"))
    np.testing.assert_array_equal(kept.q, rollout.q)


def test_cut_anywhere_all_whole_rows_before_are_there(
    rollout: Rollout, tmp_path: Path
) -> None:
    data = write(tmp_path / "a.journal", rollout).read_bytes()
    cut = tmp_path / "cut.journal"
    cut.write_bytes(data[: data.index(b"R", len(MAGIC) + 9) - 1])
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
    # The end's frame first, then row by row: never two at once, none before its time.
    assert seen[0] == len(rollout)
    assert set(np.diff(seen)) <= {0, -1}
    assert seen[-1] <= len(rollout) - 2


@given(data=st.data())
def test_a_changed_byte_ends_it_and_spoils_nothing_before(data: st.DataObject) -> None:
    path = Path(os.environ.get("TMPDIR", "/tmp")) / f"spoilt-{os.getpid()}.journal"
    try:
        journal = JournalWriter(path)
        journal.write_heading({"a": np.zeros((0, 2))}, {"what": "ä"})
        rows = np.arange(12.0).reshape(6, 1, 2)
        for row in rows:
            journal.write_row({"a": row})
        journal.close()
        whole = path.read_bytes()
        frame = 9 + 16
        first = len(whole) - 6 * frame
        at = data.draw(st.integers(first, len(whole) - 1))
        spoilt = bytearray(whole)
        spoilt[at] ^= 1 << data.draw(st.integers(0, 7))
        path.write_bytes(bytes(spoilt))
        columns, meta = read_journal(path)
        count = (at - first) // frame
        np.testing.assert_array_equal(columns["a"], rows[:count, 0])
        assert meta["what"] == "ä"
    finally:
        path.unlink(missing_ok=True)


def test_continuous_joints_are_unwound(tmp_path: Path) -> None:
    journal = JournalWriter(tmp_path / "a.journal")
    turning = np.linspace(0.0, 9.0, 40)
    wound = np.angle(np.exp(1j * turning))
    columns = {
        "t": turning,
        "q": np.zeros((40, 2)),
        "v": np.zeros((40, 1)),
        "tau": np.zeros((40, 1)),
        "joint_positions": wound[:, None],
    }
    meta = {
        "format": "hsp_control rollout 1",
        "columns": {name: {"unit": "-", "meaning": ""} for name in columns},
        "robot": {"name": "wheel", "dofs": ["turn"], "units": ["rad"],
                  "skeleton_parents": [-1], "continuous": [0]},
    }  # fmt: skip
    journal.write_heading(columns, meta)
    for i in range(40):
        journal.write_row({name: a[i : i + 1] for name, a in columns.items()})
    journal.close()
    read = Rollout.load(tmp_path / "a.journal")
    np.testing.assert_allclose(read["joint_positions"][:, 0], turning, atol=1e-12)


def test_what_is_no_journal_is_said(tmp_path: Path, rollout: Rollout) -> None:
    empty = tmp_path / "empty.journal"
    empty.write_bytes(MAGIC)
    with pytest.raises(LogError, match="ends before its first heading"):
        Rollout.load(empty)
    assert not is_journal(rollout.save(tmp_path / "b.npz"))
    with pytest.raises(LogError, match="cannot write the journal"):
        JournalWriter(empty / "below")
    with pytest.raises(LogError, match="no such file"):
        Rollout.load(tmp_path / "none.journal")


def test_a_full_disk_is_an_error_with_the_file_s_name() -> None:
    full = Path("/dev/full")
    if not full.exists():
        pytest.skip("this system has no /dev/full")
    with pytest.raises(LogError, match="/dev/full"):
        JournalWriter(full)


@pytest.mark.system
@pytest.mark.slow
def test_the_commands_take_it(
    rollout: Rollout, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = write(tmp_path / "run.journal", rollout, end=False)
    assert main(["plot", str(path), "--out", str(tmp_path)]) == 0
    assert (tmp_path / "run-paper.png").is_file()
    assert main(["check", str(path)]) == 0
    capsys.readouterr()
