"""A journal that is read while it grows says what the whole journal says."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsp_control.common.exceptions import LogError
from hsp_control.simulation.journal import JournalTail, JournalWriter, read_journal


def columns(k: int, width: int = 2) -> dict[str, np.ndarray]:
    return {"t": np.array([0.1 * k]), "q": np.full((1, width), float(k))}


def test_rows_come_as_they_are_written(tmp_path: Path) -> None:
    path = tmp_path / "a.journal"
    tail = JournalTail(path)
    assert tail.read() == 0  # it is not there yet
    writer = JournalWriter(path)
    assert tail.read() == 0
    writer.write_heading(columns(0), {"status": "running", "name": "a"})
    for k in range(3):
        writer.write_row(columns(k))
        assert tail.read() == 1
    assert tail.meta["name"] == "a"
    assert not tail.ended
    whole = tail.rows(0)
    np.testing.assert_array_equal(whole["t"], [0.0, 0.1, 0.2])
    np.testing.assert_array_equal(tail.rows(1)["q"], [[1.0, 1.0], [2.0, 2.0]])
    assert tail.rows(3)["q"].shape == (0, 2)
    writer.write_heading(columns(3, 4), {"status": "running"})
    writer.write_row(columns(3, 4))
    writer.write_end("completed", "the duration is over")
    assert tail.read() == 1
    assert tail.count == 4
    np.testing.assert_array_equal(tail.rows(0)["q"], [[3.0] * 4])  # wider columns
    assert tail.ended
    assert tail.meta["message"] == "the duration is over"
    writer.close()


@settings(max_examples=30, deadline=None)
@given(cuts=st.lists(st.integers(0, 2000), max_size=8))
def test_a_frame_that_is_half_written_waits(
    tmp_path_factory: pytest.TempPathFactory, cuts: list[int]
) -> None:
    folder = tmp_path_factory.mktemp("tail")
    writer = JournalWriter(folder / "whole")
    writer.write_heading(columns(0), {"status": "running"})
    for k in range(10):
        writer.write_row(columns(k))
    writer.write_end("completed", "")
    writer.close()
    data = (folder / "whole").read_bytes()
    growing, tail = folder / "growing", JournalTail(folder / "growing")
    found = 0
    for cut in sorted({*(min(c, len(data)) for c in cuts), len(data)}):
        growing.write_bytes(data[:cut])
        found += tail.read()
    expected, meta = read_journal(folder / "whole")
    assert found == 10
    np.testing.assert_array_equal(tail.rows(0)["q"], expected["q"])
    assert tail.meta["status"] == meta["status"]


def test_what_is_no_journal_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "b"
    path.write_bytes(b"PK\x03\x04 and more than the first line of a journal has")
    with pytest.raises(LogError, match="is no journal"):
        JournalTail(path).read()
