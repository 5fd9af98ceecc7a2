"""Camera pictures of a MuJoCo scene, as received by another process."""

import multiprocessing
import os
import socket
import subprocess
import sys
from ctypes.util import find_library
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace
from urllib.error import HTTPError
from urllib.request import urlopen

import numpy as np
import pytest
import yaml
from mjcf_texts import ARM, CELL
from PIL import Image
from played import wait_until

import hsp_control as hsp
from hsp_control.cli.robot_process import RobotProcess
from hsp_control.common.errors import HardwareError
from hsp_control.companions.cameras import pictures, show
from hsp_control.live import run_loop

pytest.importorskip("mujoco")
pytest.importorskip("OpenGL")
DRAWS = pytest.mark.skipif(not find_library("EGL"), reason="needs libegl1")

CAMERA = '<light pos="0 0 3"/><camera name="above" pos=".3 .3 .5"/></worldbody>'


@pytest.fixture
def cell(tmp_path: Path) -> hsp.Experiment:
    """An arm next to a ball, below a camera."""
    text = CELL.replace("</worldbody>", CAMERA).replace('size=".03" ', 'size=".09" ')
    mjcf = tmp_path / "cell.xml"
    mjcf.write_text(text)
    return hsp.load_experiment({
        "robot": {"mjcf": str(mjcf), "root": "base", "joints": ARM},
        "tasks": {"tip": {"type": "frame_position", "frame": "tip"}},
        "plant": "mujoco_scene",
        "simulation": {"duration": 0.1, "control_period": 0.002},
    })  # fmt: skip


@pytest.fixture
def address() -> str:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"127.0.0.1:{probe.getsockname()[1]}"


def seen(address: str, path: str) -> tuple[float, np.ndarray]:
    """Return the time and the pixels of a picture."""
    with urlopen(f"http://{address}/{path}", timeout=60.0) as answer:
        picture = Image.open(BytesIO(answer.read()))
        return float(answer.headers["Time"]), np.asarray(picture).astype(int)


@DRAWS
@pytest.mark.process
def test_a_picture_shows_the_scene_as_it_is_then(
    cell: hsp.Experiment, address: str
) -> None:
    plant = cell.plant
    assert isinstance(plant, hsp.mujoco.MujocoScenePlant)
    plant.reset(0.0, cell.q0, cell.v0)
    reported = show(address, plant)
    t, ball = seen(address, "above.png?width=64&height=48")
    assert (t, ball.shape) == (0.0, (48, 64, 3))
    _, again = seen(address, "above.jpg?width=64&height=48")
    assert np.abs(again - ball).mean() < 3.0
    plant.data.joint("ball").qpos[0] += 0.3
    plant.data.time = 1.5
    reported()
    t, floor = seen(address, "above.png?width=64&height=48")
    assert t == 1.5
    assert np.abs(floor - ball)[16:32, 24:40].mean() > 5.0
    for wrong, output in (
        ("abov.png", "no /abov.png; did you mean 'above'? (there is /above.jpg)"),
        ("above.png?width=9999", "width=9999; needs width and height, each 1 to 2048"),
    ):
        with pytest.raises(HTTPError) as caught:
            seen(address, wrong)
        assert output in caught.value.read().decode()
    with pytest.raises(
        HardwareError, match=r"pictures can be drawn: .*Address already"
    ):
        show(address, plant)


@DRAWS
@pytest.mark.process
def test_a_robot_in_its_own_process_is_seen(cell: hsp.Experiment, address: str) -> None:
    with RobotProcess(cell, cameras=f"http://{address}", lockstep=True) as robot:
        assert seen(address, "above.jpg")[0] == 0.0
        looked: list[float] = []

        def look(t: float) -> None:
            if t > 0.09 and not looked:  # the robot waits in the meantime
                wait_until(lambda: seen(address, "above.jpg")[0] >= 0.05)
                looked.append(t)

        options = {"settings": cell.scenario.live, "duration": 0.1}
        run_loop(cell.controller, robot.hardware, **options, on_period=look)
        assert looked
    with pytest.raises(OSError, match="refused"):
        seen(address, "above.jpg")


@DRAWS
@pytest.mark.process
def test_where_nothing_is_drawn_any_more_the_robot_stops(
    cell: hsp.Experiment, address: str
) -> None:
    plant = cell.plant
    assert isinstance(plant, hsp.mujoco.MujocoScenePlant)
    plant.reset(0.0, cell.q0, cell.v0)
    before = set(multiprocessing.active_children())
    reported = show(address, plant)
    (drawing,) = set(multiprocessing.active_children()) - before
    reported()
    drawing.kill()
    drawing.join()
    with pytest.raises(HardwareError, match="that draws its pictures has ended"):
        reported()


HANGING = """
import os, signal, sys
import multiprocessing
import hsp_control as hsp
from hsp_control.companions.cameras import pictures
from hsp_control.common.errors import HardwareError

if __name__ == "__main__":
    plant = hsp.load_experiment(sys.argv[1]).plant
    told = pictures.show(sys.argv[2], plant)
    (drawing,) = multiprocessing.active_children()
    os.kill(drawing.pid, signal.SIGSTOP)
    pictures._HANGS = 1.0
    try:
        while True:
            told()
    except HardwareError as error:
        print(error, drawing.pid)
"""


@DRAWS
@pytest.mark.process
def test_who_draws_and_hangs_is_noticed_and_ended(
    cell: hsp.Experiment, address: str, tmp_path: Path
) -> None:
    """A process stopped as by a debugger: Python waited forever for it at exit."""
    scenario, script = tmp_path / "cell.yaml", tmp_path / "hanging.py"
    scenario.write_text(yaml.safe_dump(cell.config))
    script.write_text(HANGING)
    command = [sys.executable, str(script), str(scenario), address]
    output = subprocess.run(
        command, capture_output=True, text=True, timeout=120.0, check=True
    )
    text, _, number = output.stdout.strip().rpartition(" ")
    assert text.endswith("draws its pictures has not responded for 1 s")
    with pytest.raises(ProcessLookupError):
        os.kill(int(number), 0)


@pytest.mark.parametrize(
    ("where", "message"),
    [("127.0.0.1", "needs http://HOST:PORT"), ("a:1", "there is no camera; needs")],
)
def test_mistakes_are_named(where: str, message: str) -> None:
    robot = hsp.Robot.load("planar3r")
    with pytest.raises(HardwareError, match=message):
        show(where, hsp.plants.RigidBodyPlant(robot))


def test_a_process_that_ends_at_once_is_not_waited_for(
    cell: hsp.Experiment, address: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The other end of its pipe is open nowhere else."""

    class Ended:
        exitcode = None

        def __init__(self, **_: object) -> None:
            pass

        def start(self) -> None:
            pass

        kill = start

    own = multiprocessing.get_context("spawn")
    names = ("Lock", "Pipe", "RawArray", "RawValue")
    context = SimpleNamespace(
        Process=Ended, **{each: getattr(own, each) for each in names}
    )
    monkeypatch.setattr(pictures.multiprocessing, "get_context", lambda _: context)
    monkeypatch.setattr(pictures, "_PATIENCE", 0.05)
    with pytest.raises(HardwareError, match="drawn: its process has ended"):
        show(address, cell.plant)
