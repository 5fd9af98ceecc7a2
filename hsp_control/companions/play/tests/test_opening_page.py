"""Opening a page, and its content before the scene is ready."""

import sys
from argparse import Namespace
from asyncio import CancelledError
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

import hsp_control as hsp
from hsp_control.cli import main
from hsp_control.cli.live_experiment import live_period
from hsp_control.common.errors import ViewerError
from hsp_control.companions.play import steering
from hsp_control.companions.play.live_loop import channel_pair
from hsp_control.companions.play.playable import playable
from hsp_control.companions.play.steering import PageProcess, SteeringPage
from hsp_control.companions.viewer import SceneRecorder, Viewer, transport
from hsp_control.companions.viewer.commands import unpack
from hsp_control.companions.viewer.live_picture import Picture
from hsp_control.companions.viewer.pages import OpeningPage, draw_before
from hsp_control.config.document import read_document
from hsp_control.config.loaded_scenario import load_scenario
from hsp_control.live import OperatorRequests

PLAYED = "hsp_control.companions.play.real_time.play"


class Said:
    """A page that records its messages."""

    def __init__(self) -> None:
        self.events: list[str] = []
        options = Namespace(browser=True)
        self.page = OpeningPage("http://x/", options, self.events.append)


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Said:
    said = Said()

    def open_browser(url: str) -> bool:
        said.events.append("browser")
        return True

    monkeypatch.setattr(transport, "open_browser", open_browser)
    return said


def transforms(recorder: SceneRecorder) -> dict[str, bytes]:
    return {path: packed for path, kind, packed in recorder.scene.items()
            if kind == "transform"}  # fmt: skip


def test_it_opens_once(said: Said) -> None:
    assert not said.page.opened
    said.page.open()
    said.page.open()
    assert said.events == ["http://x/", "browser"]
    assert said.page.opened


def test_the_robot_is_drawn_at_its_start() -> None:
    document = read_document("panda_obstacle")
    document.override("start={joints: {panda_joint4: -1.0}}")
    loaded = load_scenario(document)
    recorder = SceneRecorder()
    viewer = Viewer(loaded.robot, transport=recorder)
    draw_before(viewer, loaded)
    captions = [unpack(packed)["title"] for _, kind, packed in recorder.scene.items()
                if kind == "caption"]  # fmt: skip
    assert captions == [loaded.scenario.title]
    drawn = transforms(recorder)
    viewer.show(loaded.robot.home())
    home = transforms(recorder)
    moved = {path for path in drawn if drawn[path] != home[path]}
    assert "/robot/panda_joint5" in moved
    assert "/robot/panda_joint3" not in moved


@pytest.fixture(scope="module")
def experiment() -> hsp.Experiment:
    return playable("planar3r")


def test_a_silent_page_ends_the_wait(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    silent = tmp_path / "python"
    silent.write_text("#!/bin/sh\nexec sleep 600\n")
    silent.chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(silent))
    monkeypatch.setattr(steering, "START", 0.05)
    page = PageProcess(port=None, host="127.0.0.1", held=True)
    with pytest.raises(ViewerError, match=r"did not start within 0\.05 s"):
        page.__enter__()
    assert page._process.poll() is not None


def test_a_page_shows_no_rows_of_an_earlier_loop(
    experiment: hsp.Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    said = list[dict[str, Any]]()
    page = object.__new__(PageProcess)
    monkeypatch.setattr(page, "_say", said.append)
    monkeypatch.chdir(tmp_path)
    journal = Path("live.journal")
    for _ in range(2):  # the second time there is none
        page.begin(experiment, journal)
        assert not journal.exists()
        journal.write_text("of an earlier loop")
    page.begin(experiment, journal)
    assert not journal.exists()
    assert {each["journal"] for each in said} == {str(tmp_path / journal)}
    assert {each["period"] for each in said} == {live_period(experiment)}


def test_a_page_that_dies_before_its_key_was_held(
    experiment: hsp.Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither moved nor stopped by the user: an error."""
    channel, there = channel_pair()
    process = SimpleNamespace(
        channel=channel, held=True, begin=lambda *_: there.close()
    )
    ready: list[bool] = []
    opening = SimpleNamespace(open=lambda: ready.append(True))
    page = SteeringPage(process, opening)  # type: ignore[arg-type]
    monkeypatch.setattr(steering, "_rehearse", lambda *_: None)
    with pytest.raises(ViewerError, match="before its key was held"):
        page.let_steer(experiment, OperatorRequests(), tmp_path / "journal")
    assert ready == [True]  # it was open
    channel.close()


def test_a_play_that_failed_and_was_not_reset_says_so_with_its_status(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(session: Any, *_: Any, **__: Any) -> None:
        session.over = "the arm is too fast; reset to go on"

    monkeypatch.setattr(PLAYED, fail)
    arguments = ["paper/4_moving_obstacle", "--out", str(tmp_path), "--no-browser"]
    assert main(["play", *arguments]) == 2
    assert capsys.readouterr().err.endswith("hsp: the arm is too fast\n")
    monkeypatch.setattr(PLAYED, lambda *_, **__: None)
    assert main(["play", *arguments]) == 0


@pytest.mark.parametrize("error", [ViewerError("no page"), CancelledError()])
def test_a_play_that_cannot_be_drawn_is_saved(
    error: BaseException,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def fail(*_: Any, **__: Any) -> None:
        raise error

    monkeypatch.setattr(Picture, "draw", fail)
    arguments = ["planar3r", "--out", str(tmp_path), "--no-browser"]
    assert main(["play", *arguments]) == 2
    assert len(list(tmp_path.glob("*-play.npz"))) == 1
    wanted = "hsp: cannot draw the play: CancelledError\n", "hsp: no page\n"
    assert capsys.readouterr().err.endswith(wanted)
