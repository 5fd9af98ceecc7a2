"""`hsp live --steer` as processes: the loop, the robot, and a page that steers both."""

import os
import re
import signal
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any

import pytest
from pages import Steering
from places import further
from played import wait_until

import hsp_control as hsp
from hsp_control.cli import main

# On a busy machine, processes wait for one another.
PATIENT = ["--lockstep", "--set=simulation.control_period=0.002"]


class SteeredLive:
    def __init__(self, *arguments: str) -> None:
        command = ["live", "panda_obstacle", "--no-browser", "--duration=inf"]
        self.process = subprocess.Popen(
            [sys.executable, "-m", "hsp_control", *command, *PATIENT, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
        )
        assert self.process.stdout is not None
        self.before = ""  # its output before it had an address
        for line in self.process.stdout:
            self.before += line
            if found := re.match(r"Steer: (http\S+)", line):
                self.url = found[1]
                break

    def text(self) -> str:
        return str(self.process.communicate(timeout=120.0)[0])


@pytest.fixture
def arguments(tmp_path: Path) -> list[str]:
    return [f"--out={tmp_path}"]


def last(page: Steering, kind: str) -> dict[str, Any]:
    return [command for command in page.commands if command["type"] == kind][-1]


def moving(page: Steering) -> bool:
    found = [command for command in page.commands if command["type"] == "play_state"]
    return bool(found) and found[-1]["t"] > 0.1


@pytest.mark.process
def test_a_page_moves_the_hand_and_stops_the_robot(
    arguments: list[str], tmp_path: Path
) -> None:
    live = SteeredLive("--steer", *arguments)
    page = Steering(live.url)
    wait_until(lambda: moving(page), 120.0)
    assert last(page, "play_setup")["loop"] == "live"
    pose = list(last(page, "play_setup")["targets"][0]["pose"])
    pose[2] += 0.05
    begun = last(page, "play_state")["t"]
    page.say(do="move", target="hand", pose=pose)

    def reached() -> bool:
        # In the period in which it is sent, the page shows the commanded target.
        hand = last(page, "play_targets")["poses"]["hand"]
        moved = last(page, "play_state")["t"] > begun + 0.5
        return moved and abs(hand[2] - pose[2]) < 1e-6

    wait_until(reached)
    page.say(do="stop")
    text = live.text()
    assert live.process.returncode == 0, text
    assert "The loop: stopped from the page" in text
    assert "Warning" not in live.before + text
    log = hsp.Rollout.load(tmp_path / "panda_obstacle-live.npz")
    assert log["task.hand.reference"][-1, 2] == pytest.approx(pose[2])


@pytest.mark.process
@pytest.mark.parametrize("steer", further("hardware"))  # test_steered_loop.py has more
def test_a_robot_moves_while_the_key_is_held(
    steer: str, arguments: list[str], tmp_path: Path
) -> None:
    live = SteeredLive(f"--steer={steer}", *arguments)
    page = Steering(live.url)
    wait_until(lambda: any(c["type"] == "play_setup" for c in page.commands), 120.0)
    assert last(page, "play_setup")["loop"] == "held"
    assert not moving(page)  # until the key is held
    let_go = threading.Event()

    def hold() -> None:
        while not let_go.wait(0.05):
            page.say(do="hold", held=True)

    holding = threading.Thread(target=hold)
    holding.start()
    wait_until(lambda: moving(page) or live.process.poll() is not None)
    let_go.set()  # without a message
    holding.join()
    text = live.text()
    assert live.process.returncode == 0, text
    assert "The loop: the dead-man's key was released" in text
    assert (tmp_path / "panda_obstacle-live.npz").is_file()


@pytest.mark.process
def test_it_fails_if_its_page_dies(arguments: list[str]) -> None:
    live = SteeredLive("--steer", *arguments)
    page = Steering(live.url)
    wait_until(lambda: moving(page), 120.0)
    pid = live.process.pid
    for child in map(int, Path(f"/proc/{pid}/task/{pid}/children").read_text().split()):
        if "play.steering" in Path(f"/proc/{child}/cmdline").read_text():
            os.kill(child, signal.SIGKILL)
    text = live.text()
    assert live.process.returncode == 2, text
    assert "the process of the page has ended" in text


@pytest.mark.parametrize(("arguments", "message"), [
    (["--steer", "--robot=arm://x"], "use --steer hardware"),
    (["--port=7100"], "need --steer"),
])  # fmt: skip
def test_nonsensical_input_is_refused(
    arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["live", "panda_obstacle", *arguments]) == 2
    assert message in capsys.readouterr().err
