"""Journals: readable around absurd rows, whole after Ctrl-C."""

import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from live_rigs import PERIOD, Rig, law, watched

from hsp_control import Rollout
from hsp_control.common.exceptions import LogError
from hsp_control.live import LiveSettings, Phase, StopSettings, run_loop
from hsp_control.simulation import journal
from hsp_control.simulation.journal import JournalWriter, read_journal

QUICK = LiveSettings(stop=StopSettings(hold=0.02))


def run(log: Path, **options: Any) -> Any:
    options = {"duration": 0.06, "log_period": PERIOD, "settings": QUICK} | options
    return run_loop(law(), Rig(watched(QUICK)), log=log, **options)


# --- absurd rows ---------------------------------------------------------------------


@pytest.mark.parametrize("value", [1e300, -1e13, np.nan, np.inf])
@pytest.mark.parametrize("name", ["q", "v", "tau", "joint_positions", "skeleton"])
def test_absurd_rows_are_left_out_and_counted(
    tmp_path: Path, name: str, value: float
) -> None:
    run(tmp_path / "a.journal")
    whole = Rollout.load(tmp_path / "a.journal")
    columns, meta = read_journal(tmp_path / "a.journal")
    columns[name][10:12] = value
    writer = JournalWriter(tmp_path / "b.journal")
    writer.write_heading(columns, meta)
    for i in range(len(columns["t"])):
        writer.write_row({key: column[i : i + 1] for key, column in columns.items()})
    writer.write_end("stopped", "a fault")
    writer.close()
    read = Rollout.load(tmp_path / "b.journal")
    assert read.meta["message"] == (
        f"a fault; 2 of {len(whole)} rows are left out, from t = {whole.t[10]:g} s on: "
        "their numbers are too large, or not finite"
    )
    np.testing.assert_array_equal(read.t, np.delete(whole.t, [10, 11]))
    np.testing.assert_array_equal(read["q"], np.delete(whole.q, [10, 11], axis=0))


# --- Ctrl-C --------------------------------------------------------------------------


class Interrupting:
    """`os.write` that is interrupted once, before, within or after a row.

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


@pytest.mark.system
@pytest.mark.parametrize("cut", [0, 5, 200, None])
@pytest.mark.parametrize("row", [20, -1])
def test_ctrl_c_within_a_row_loses_none(
    cut: int | None, row: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also within the end of the journal, which is its last frame."""
    whole = tmp_path / "whole.journal"
    counted = Interrupting(None, -1)
    monkeypatch.setattr(journal.os, "write", counted)
    assert run(whole).ended == "completed"
    at = row if row > 0 else counted.calls
    monkeypatch.setattr(journal.os, "write", Interrupting(cut, at))
    report = run(tmp_path / "cut.journal")
    monkeypatch.undo()
    read, reference = Rollout.load(tmp_path / "cut.journal"), Rollout.load(whole)
    if row > 0:
        assert report.ended == "operator"
        assert read.status == "interrupted"
        assert read["live.phase"][row - 3] == Phase.RUNNING  # magic, heading, rows
    else:
        assert report.ended == read.status == "completed"
        assert len(read) == len(reference)
    np.testing.assert_allclose(np.diff(read.t), PERIOD, rtol=1e-6)  # none is missing
    count = row - 2 if row > 0 else len(read)
    np.testing.assert_array_equal(read.q[:count], reference.q[:count])


def test_a_disk_that_is_full_for_a_moment_leaves_a_whole_journal(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A part of a frame is taken back, so that the end can still be written."""
    path, write = tmp_path / "a.journal", os.write

    def full(file: int, data: bytes) -> int:
        if 1_000 > len(data) > 900:
            write(file, data[:100])
            raise OSError(28, "No space left on device")
        return write(file, data)

    monkeypatch.setattr(journal.os, "write", full)
    writer = JournalWriter(path)
    writer.write_heading({"a": np.zeros(0)}, {"what": 1})
    writer.write_row({"a": np.ones(1)})
    with pytest.raises(LogError, match="No space left"):
        writer.write_heading({"a": np.zeros(0)}, {"what": "x" * 930})
    writer.write_end("stopped", "the disk is full")
    writer.close()
    columns, meta = read_journal(path)
    assert meta == {"what": 1, "status": "stopped", "message": "the disk is full"}
    np.testing.assert_array_equal(columns["a"], [1.0])
