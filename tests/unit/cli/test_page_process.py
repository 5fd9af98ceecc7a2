"""The process of a live loop's page, where it does not start or dies early."""

import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

import hsp_control as hsp
from hsp_control.cli import steering
from hsp_control.cli.steering import PageProcess, SteeringPage
from hsp_control.common.exceptions import ViewerError
from hsp_control.live import OperatorRequests
from hsp_control.play.live_loop import channel_pair
from hsp_control.play.playable import playable


@pytest.fixture(scope="module")
def experiment() -> hsp.Experiment:
    return playable("planar3r")


def test_a_page_that_says_nothing_ends_the_wait(
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


def test_a_page_that_dies_before_its_key_was_held(
    experiment: hsp.Experiment, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing has moved, and nobody has stopped it: that is an error."""
    channel, there = channel_pair()
    process = SimpleNamespace(
        channel=channel, held=True, begin=lambda *_: there.close()
    )
    ready: list[bool] = []
    opening = SimpleNamespace(ready=lambda: ready.append(True))
    page = SteeringPage(process, opening)  # type: ignore[arg-type]
    monkeypatch.setattr(steering, "_rehearse", lambda *_: None)
    with pytest.raises(ViewerError, match="before anybody held its key"):
        steering.let_steer(page, experiment, OperatorRequests(), tmp_path / "journal")
    assert ready == [True]  # it was open
    channel.close()
