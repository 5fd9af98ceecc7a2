"""The robot and the leader as called by LeRobot, and LeRobot's commands."""

import json
import os
import subprocess
import sys
from pathlib import Path
from time import monotonic, sleep

import av
import numpy as np
import pyarrow.parquet as parquet
import pytest
from hsp_datagrams import LoopError
from lerobot.robots import make_robot_from_config
from lerobot_robot_hsp import HspCamera, HspCameraConfig, HspRobot, HspRobotConfig

from conftest import Running, free_port

POSE = ["ee.x", "ee.y", "ee.z", "ee.wx", "ee.wy", "ee.wz"]


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
    robot = make_robot_from_config(config(arm))
    assert isinstance(robot, HspRobot)
    assert list(robot.action_features) == [*POSE, "gripper.pos"]
    seen = robot.observation_features
    assert {"panda_joint7.vel", "ee.fz", "ee.bounded", "limited"} < set(seen)
    with robot:
        first = robot.get_observation()
        assert set(first) == set(seen)
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
        # The loop accepts one sender, that of the last test until it is silent for 2 s.
        while robot.arm.loop.state()["streams"]["fingers"]["age"] < 2.5:
            sleep(0.1)
        robot.send_action({"panda_finger_joint1.pos": 0.01})
        settled(robot, "panda_finger_joint1.pos", 0.01, 1e-4)
        robot.send_action({"panda_finger_joint1.pos": 0.02})


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"task": "tip"}, r"no task 'tip'; it has \['hand', 'fingers'\]"),
        ({"action": "joints"}, "task 'hand' moves no joints"),
        ({"frame": "wrist"}, "publishes no pose of 'wrist'"),
    ],
)
def test_missing_parts_of_the_loop_are_named(
    arm: Running, changes: dict, message: str
) -> None:
    with pytest.raises(LoopError, match=message):
        HspRobot(config(arm, **changes)).connect()


def test_without_a_loop_the_message_has_the_command() -> None:
    states = f"127.0.0.1:{free_port()}"
    robot = HspRobot(HspRobotConfig(states=states, timeout=0.1))
    with pytest.raises(LoopError, match=f"hsp live CONFIG .* udp://{states}"):
        robot.connect()


def lerobot(command: str, home: Path, options: dict) -> str:
    """Run a command of LeRobot without a hub; return its output."""
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


def words_of(arm: Running) -> tuple[dict, dict]:
    """Return the options of a robot, and those of the leader's gripper."""
    robot = {
        "robot.type": "hsp",
        "robot.states": arm.states,
        "robot.targets": arm.targets,
        "robot.gripper_task": "fingers",
        "robot.gripper_targets": arm.gripper,
    }
    return robot, {"teleop.gripper_task": "fingers"}


RECORDING = {
    "dataset.single_task": "follow the circle",
    "dataset.push_to_hub": "false",
    "dataset.num_episodes": 1,
    "dataset.episode_time_s": 6,
    "dataset.reset_time_s": 0,
}


@pytest.mark.parametrize("kind", ["arm", "franka"])
def test_lerobot_s_commands_teleoperate_record_and_replay(
    request: pytest.FixtureRequest, kind: str, leader: str, tmp_path: Path
) -> None:
    arm: Running = request.getfixturevalue(kind)
    robot, gripper = words_of(arm)
    teleop = {"teleop.type": "hsp_leader", "teleop.states": leader, **gripper}
    lerobot("teleoperate", tmp_path, {**robot, **teleop, "teleop_time_s": 2})
    data: dict = {"dataset.repo_id": "me/circle", "play_sounds": "false"}
    lerobot("record", tmp_path, {**robot, **teleop, **data, **RECORDING})
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
    # The replay ran last: it begins where messages resume.
    taken, t = log["stream.hand.taken"], log["t"]
    begin = t[np.searchsorted(taken, taken[-1] - len(action) + 1)]
    replayed = log["task.hand.actual"][t > begin + 1.0, :3]
    fine = np.linspace(0, len(recorded) - 1, 10 * len(recorded))
    path = np.array([np.interp(fine, range(len(recorded)), p) for p in recorded.T[:3]])
    away = np.linalg.norm(replayed[:, :, None] - path, axis=1).min(axis=1)
    print(f"the replay is within {1e3 * away.max():.2f} mm of the recording")
    assert away.max() < 0.01  # on a busy machine
    opening = state[:, names["observation.state"]["names"].index("gripper.pos")]
    assert np.ptp(opening) > 0.01
    if kind == "arm":
        assert np.ptp(log["task.fingers.actual"][t > begin + 1.0]) > 0.01
    assert log["stream.hand.rejected"][-1] == 0


def test_cameras_of_the_scene_are_recorded(
    seen: Running, leader: str, tmp_path: Path
) -> None:
    robot, gripper = words_of(seen)
    size = f"width: 160, height: 120, fps: 10, url: '{seen.cameras}'"
    views = {"front": "front", "hand": "wrist"}
    cameras = [f"{k}: {{type: hsp, camera: {v}, {size}}}" for k, v in views.items()]
    options = {
        **robot,
        "robot.cameras": f"{{{', '.join(cameras)}}}",
        **gripper,
        "teleop.type": "hsp_leader",
        "teleop.states": leader,
        "play_sounds": "false",
        "dataset.repo_id": "me/pictures",
        **RECORDING,
        "dataset.fps": 10,
    }
    lerobot("record", tmp_path, options)
    (folder,) = tmp_path.glob("me/pictures*")
    moved = []
    for name in views:
        (film,) = (folder / "videos" / f"observation.images.{name}").rglob("*.mp4")
        with av.open(film) as opened:
            frames = [each.to_ndarray(format="rgb24") for each in opened.decode()]
        pictures = [each.astype(int) for each in frames]
        assert 20 < len(pictures) <= 60
        red = [(each[..., 0] > each[..., 1] + 40).any() for each in pictures]
        assert sum(red) > 0.5 * len(red)  # the cube
        moved.append(np.abs(pictures[-1] - pictures[0]).mean())
    assert min(moved) > 1.0
    with pytest.raises(ConnectionError, match=r"no /side\.jpg\?.*there is /front\.jpg"):
        HspCamera(
            HspCameraConfig(camera="side", url=seen.cameras, width=8, height=8, fps=9)
        ).connect()
