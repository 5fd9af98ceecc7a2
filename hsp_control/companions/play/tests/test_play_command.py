"""`hsp play` as a process: a page steers it, stalls, and leaves; the log is saved."""

import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pages import Steering
from played import Played, wait_until

import hsp_control as hsp
from hsp_control.cli import main


@pytest.fixture
def played(tmp_path: Path) -> Iterator[Played]:
    process = Played("panda_obstacle", "--out", str(tmp_path))
    yield process
    process.close()


def last(page: Steering, kind: str) -> dict[str, Any] | None:
    found = [command for command in page.commands if command["type"] == kind]
    return found[-1] if found else None


@pytest.mark.process
def test_a_page_steers_and_the_log_repeats_it(played: Played, tmp_path: Path) -> None:
    page = Steering(played.url)
    wait_until(lambda: last(page, "play_targets"))
    setup = last(page, "play_setup")
    assert setup is not None
    pose = list(setup["targets"][0]["pose"])
    pose[2] += 0.1

    def height() -> float:
        targets = last(page, "play_targets")
        assert targets is not None
        return float(targets["poses"]["hand"][2])

    begun = last(page, "play_state")["t"]
    page.say(do="move", target="hand", pose=pose)
    wait_until(lambda: last(page, "play_state")["t"] > begun + 0.5)
    wait_until(lambda: abs(height() - pose[2]) < 1e-6)
    page.say(do="set", id="null_space_gain", value=20.0)
    wait_until(lambda: last(page, "play_values")["values"]["null_space_gain"] == 20.0)
    page.say(do="dance")
    wait_until(lambda: "cannot do" in last(page, "play_state")["message"])
    page.say(do="pause")
    wait_until(lambda: not last(page, "play_state")["running"])
    page.say(do="save")
    wait_until(lambda: last(page, "play_state")["message"].startswith("saved: "))
    assert (tmp_path / "panda_obstacle-play.npz").is_file()
    page.leave()
    page.join(60.0)
    text = played.end()
    assert played.process.returncode == 0, text
    log = hsp.Rollout.load(tmp_path / "panda_obstacle-play.npz")
    assert log["task.hand.reference"][-1, 2] == pytest.approx(pose[2])
    again = hsp.load_experiment(tmp_path / "panda_obstacle-play.npz").run()
    np.testing.assert_array_equal(again.q, log.q)


@pytest.mark.process
def test_a_page_that_stalls_or_leaves_holds_nothing_up(
    played: Played, tmp_path: Path
) -> None:
    stalled = Steering(played.url, pause=1e9)  # reads one message only
    wait_until(lambda: stalled.commands)
    other = Steering(played.url)
    wait_until(lambda: last(other, "play_state"))
    begin = last(other, "play_state")["t"]
    wait_until(lambda: last(other, "play_state")["t"] > begin + 2.0)
    pulled = {"path": "/robot/panda_joint4/panda_link4", "point": [0.0, 0.0, 0.6]}
    other.say(do="take_over")
    wait_until(lambda: other.drives() == (True, True))
    other.say(do="pull", **pulled, to=[0.0, 0.2, 0.6])
    wait_until(lambda: last(other, "play_force")["visible"])
    watching = Steering(played.url)
    wait_until(lambda: last(watching, "play_force"))
    other.leave()  # during a pull
    wait_until(lambda: not last(watching, "play_force")["visible"])
    text = played.end(signal.SIGTERM)
    assert played.process.returncode == 0, text
    assert (tmp_path / "panda_obstacle-play.npz").is_file()


@pytest.mark.process
@pytest.mark.smoke
@pytest.mark.parametrize(("arguments", "message"), [
    (["whole_body"], "no configuration 'whole_body'"),
    (["talos"], "talos has a free-flyer root"),
    (["panda", "--host", "0.0.0.0"], "every address of this computer"),
    (["panda", "--host", "192.0.2.1"], "cannot listen on 192.0.2.1"),
    (["panda", "--set", "null_space.gain=-1"], "null_space.gain"),
])  # fmt: skip
def test_mistakes_are_one_line(
    arguments: list[str],
    message: str,
    tmp_path: Path,
    capfd: pytest.CaptureFixture[str],
) -> None:
    """Also if the page's process notices it first."""
    assert main(["play", "--no-browser", *arguments, "--out", str(tmp_path)]) == 2
    reported = capfd.readouterr()
    assert message in reported.err
    assert "Traceback" not in reported.out + reported.err
