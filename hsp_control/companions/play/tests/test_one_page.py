"""A play as one page: a process writes it and reports the outcome."""

from pathlib import Path

import pytest
from played import wait_until

import hsp_control as hsp
from hsp_control.companions.play.one_page import OnePage


def written(tmp_path: Path, page: Path) -> str:
    arm = hsp.Robot.load("planar3r")
    controller = hsp.Controller(arm, [hsp.JointPosture("start")], limits=None)
    run = hsp.simulate(controller, arm.home(), duration=0.05, control_period=0.01)
    one = OnePage(lambda: run.save(tmp_path / "mine.npz"), page)
    assert one.done() == ""
    assert one.begin() == one.begin() == f"writing {page} …"  # one at a time
    reported: list[str] = []
    wait_until(lambda: bool(reported.append(one.done()) or reported[-1]))
    one.close()
    return reported[-1]


@pytest.mark.process
def test_a_play_is_written_as_one_page(tmp_path: Path) -> None:
    page = tmp_path / "mine.html"
    assert written(tmp_path, page) == f"saved: {page}"
    assert "<canvas" in page.read_text() or page.stat().st_size > 100_000


@pytest.mark.system
def test_an_unwritable_file_gives_the_reason(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    assert "hsp: " in written(tmp_path, tmp_path / "file" / "mine.html")
