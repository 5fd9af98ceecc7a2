"""`make lint`: what it says of the lines of a room."""

import runpy
from pathlib import Path

from places import ROOT

tool = runpy.run_path(str(ROOT / "tools" / "budget.py"))


def test_what_is_too_long_and_what_has_no_budget(tmp_path: Path) -> None:
    room = tmp_path / "hsp_control" / "law" / "deeper"
    room.mkdir(parents=True)
    walking = tmp_path / "hsp_control" / "companions"
    walking.mkdir()
    (walking / "w.py").write_text("a\n", encoding="utf-8")
    (room / "x.py").write_text("a\nb\nc\n", encoding="utf-8")
    (room.parent / "y.js").write_text("a\n", encoding="utf-8")
    (tmp_path / "hsp_control" / "__init__.py").write_text("a\n", encoding="utf-8")
    found = tool["counted"](tmp_path)
    assert found["law"] == 3
    assert (found["package"], found["core"]) == (5, 4)
    assert found["scripts"] == 1
    allowed = {**found, "law": 2, "moon": 5}
    del allowed["pages"]
    assert tool["wrong"](found, allowed) == [
        "law: 3 lines, 1 more than its budget",
        "pages: 0 lines, and no budget",
        "moon: a budget of nothing",
    ]
    assert tool["wrong"](found, found) == []
