"""The robot and the leader as LeRobot calls them, and LeRobot's own commands."""

import json
import os
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from time import monotonic, sleep

import numpy as np
import pyarrow.parquet as parquet
import pytest
from conftest import Running, free_port
from hsp_datagrams import LoopError
from lerobot.cameras import Camera, CameraConfig
from lerobot.robots import make_robot_from_config
from lerobot_robot_hsp import HspRobot, HspRobotConfig

POSE = ["ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz"]


@CameraConfig.register_subclass("still")
@dataclass(kw_only=True)
class StillConfig(CameraConfig):
    """A camera that sees the same always."""


class Still(Camera):
    is_connected = False

    @staticmethod
    def find_cameras() -> list:
        return []

    def connect(self, warmup: bool = True) -> None:
        self.is_connected = True

    def read(self) -> np.ndarray:
        return np.full((self.height, self.width, 3), 7, np.uint8)

    def async_read(self, timeout_ms: float = 200) -> np.ndarray:
        return self.read()

    def disconnect(self) -> None:
        self.is_connected = False


def config(arm: Running, **changes: object) -> HspRobotConfig:
    given = {"gripper_task": "fingers", "gripper_targets": arm.gripper, **changes}
    return HspRobotConfig(states=arm.states, targets=arm.targets, **given)


def settled(robot: HspRobot, name: str, value: float, near: float) -> dict:
    """Return the first observation in which a number is near a value."""
    end = monotonic() + 120.0
    while abs((seen := robot.get_observation())[name] - value) > near:
        assert monotonic() < end, seen
        sleep(0.02)
    return seen


def test_it_moves_the_hand_and_the_fingers_and_sees_them(arm: Running) -> None:
    cameras = {"front": StillConfig(fps=30, width=8, height=6)}
    robot = make_robot_from_config(config(arm, cameras=cameras))
    assert isinstance(robot, HspRobot)
    assert list(robot.action_features) == [*POSE, "gripper.pos"]
    seen = robot.observation_features
    assert seen["front"] == (6, 8, 3)
    assert {"panda_joint7.vel", "ee.fz", "ee.bounded", "limited"} < set(seen)
    with robot:
        first = robot.get_observation()
        assert set(first) == set(seen)
        assert (first["front"] == 7).all()
        goal = {name: first[name] for name in POSE}
        goal |= {"ee.z": first["ee.z"] + 0.03, "gripper.pos": 0.03}
        assert robot.send_action(goal) == pytest.approx(goal)
        settled(robot, "gripper.pos", 0.03, 1e-4)
        settled(robot, "ee.z", goal["ee.z"], 1e-3)
        times = [0.1 * k for k in range(1, 6)]
        chunk = [goal | {"ee.z": goal["ee.z"] - 0.06 * t} for t in times]
        robot.send_chunk(chunk, times)
        settled(robot, "ee.z", first["ee.z"], 1e-3)
        robot.send_action(goal | {"ee.x": 2.0})
        assert robot.get_observation()["ee.bounded"] == 0.0  # the reference moves there
        far = settled(robot, "ee.bounded", 1.2, 0.2)
        assert far["ee.x"] < 1.0
        robot.send_action({name: first[name] for name in goal})
        settled(robot, "ee.z", first["ee.z"], 1e-3)
        with pytest.raises(ValueError, match=r"the action has no ee\.y"):
            robot.send_action({"ee.x": 0.3})
    assert not robot.is_connected


def test_actions_may_be_joint_positions(arm: Running) -> None:
    robot = HspRobot(
        HspRobotConfig(
            states=arm.states, targets=arm.gripper, task="fingers", action="joints"
        )
    )
    assert list(robot.action_features) == ["panda_finger_joint1.pos"]
    with robot:
        robot.send_action({"panda_finger_joint1.pos": 0.01})
        settled(robot, "panda_finger_joint1.pos", 0.01, 1e-4)
        robot.send_action({"panda_finger_joint1.pos": 0.02})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"task": "tip"}, r"no task 'tip'; it has \['hand', 'fingers'\]"),
        ({"action": "joints"}, "task 'hand' moves no joints"),
        ({"frame": "wrist"}, "tells no pose of 'wrist'"),
    ],
)
def test_what_the_loop_lacks_is_named(
    arm: Running, changes: dict, message: str
) -> None:
    with pytest.raises(LoopError, match=message):
        HspRobot(config(arm, **changes)).connect()


def test_without_a_loop_it_says_how_to_start_one() -> None:
    states = f"127.0.0.1:{free_port()}"
    robot = HspRobot(HspRobotConfig(states=states, timeout=0.1))
    with pytest.raises(LoopError, match=f"hsp live CONFIG .* udp://{states}"):
        robot.connect()


def lerobot(command: str, home: Path, options: dict) -> str:
    """Run a command of LeRobot without a hub; return what it says."""
    words = [f"--{name}={value}" for name, value in options.items()]
    done = subprocess.run(
        [str(Path(sys.executable).parent / f"lerobot-{command}"), *words],
        env={**os.environ, "HF_HUB_OFFLINE": "1", "HF_LEROBOT_HOME": str(home)},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stdout[-4000:]
    return done.stdout


def test_lerobot_s_commands_teleoperate_record_and_replay(
    arm: Running, leader: str, tmp_path: Path
) -> None:
    robot = {
        "robot.type": "hsp",
        "robot.states": arm.states,
        "robot.targets": arm.targets,
        "robot.gripper_task": "fingers",
        "robot.gripper_targets": arm.gripper,
    }
    teleop = {
        "teleop.type": "hsp_leader",
        "teleop.states": leader,
        "teleop.gripper_task": "fingers",
    }
    lerobot("teleoperate", tmp_path, {**robot, **teleop, "teleop_time_s": 2})
    data: dict = {"dataset.repo_id": "me/circle", "play_sounds": "false"}
    recording = {
        "dataset.single_task": "follow the circle",
        "dataset.push_to_hub": "false",
        "dataset.num_episodes": 1,
        "dataset.episode_time_s": 6,
        "dataset.reset_time_s": 0,
    }
    lerobot("record", tmp_path, {**robot, **teleop, **data, **recording})
    (folder,) = tmp_path.glob("me/circle*")  # later versions append the time
    data |= {"dataset.repo_id": f"me/{folder.name}", "dataset.episode": 0}
    lerobot("replay", tmp_path, {**robot, **data})
    log = np.load(arm.stop())
    names = json.loads((folder / "meta/info.json").read_text())["features"]
    (file,) = (folder / "data").rglob("*.parquet")
    table = parquet.read_table(file)
    action, state = (
        np.array(table[key].to_pylist()) for key in ("action", "observation.state")
    )
    assert names["action"]["names"] == [*POSE, "gripper.pos"]
    at = [names["observation.state"]["names"].index(name) for name in POSE]
    recorded = state[:, at]
    assert np.ptp(recorded[:, 1]) > 0.1
    assert 60 < len(action) <= 180
    # The replay ran last: it begins where the messages begin again.
    taken, t = log["stream.hand.taken"], log["t"]
    begin = t[np.searchsorted(taken, taken[-1] - len(action) + 1)]
    replayed = log["task.hand.actual"][t > begin + 1.0, :3]
    fine = np.linspace(0, len(recorded) - 1, 10 * len(recorded))
    path = np.array([np.interp(fine, range(len(recorded)), p) for p in recorded.T[:3]])
    away = np.linalg.norm(replayed[:, :, None] - path, axis=1).min(axis=1)
    print(f"the replay is within {1e3 * away.max():.2f} mm of what was recorded")
    assert away.max() < 0.01  # on a machine that does more besides
    opened = log["task.fingers.actual"][t > begin + 1.0]
    assert np.ptp(opened) > 0.01
    assert log["stream.hand.rejected"][-1] == 0
