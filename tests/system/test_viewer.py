"""The view shows what Pinocchio computed, to this machine alone, and leaves nothing."""

import logging
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
import urllib.error
import urllib.request
import webbrowser
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from dataclasses import replace
from http.client import HTTPConnection
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from clips import Clip
from pages import Page

from hsp_control import Obstacle, Robot, Rollout, Scene, load_experiment
from hsp_control.common.exceptions import ConfigError, ViewerError
from hsp_control.geometry.shapes import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    HeightField,
    Mesh,
    PointCloud,
    Shape,
    Sphere,
)
from hsp_control.trajectories import Hold, UniformLine
from hsp_control.visualization.viewer import (
    Recorder,
    Viewer,
    browser,
    robot_of,
    server,
    view_logs,
)
from hsp_control.visualization.viewer.commands import CAMERA, CAPTION, CLIP
from hsp_control.visualization.viewer.kept import Kept, key_of
from hsp_control.visualization.viewer.motion import motion_of
from hsp_control.visualization.viewer.records import (
    DELETE,
    SET,
    Decoder,
    Record,
    encode,
)
from hsp_control.visualization.viewer.server import Server
from hsp_control.visualization.viewer.threejs import _Y_TO_Z

MOVING = "paper/4_moving_obstacle"
LINUX = pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")


@pytest.fixture(scope="module")
def run() -> Rollout:
    return load_experiment(MOVING, "simulation.duration=1.5").run()


@pytest.fixture(scope="module")
def arm() -> Robot:
    return Robot.load("planar3r")


@pytest.fixture
def recorder() -> Recorder:
    return Recorder()


@pytest.fixture
def started() -> Iterator[Server]:
    with_process = Server()
    yield with_process
    with_process.close()


def children(recorder: Recorder, path: str) -> list[dict[str, Any]]:
    command = recorder.command(path, "object")
    assert command is not None
    return list(command["object"]["object"]["children"])


def matrix(thing: dict[str, Any]) -> np.ndarray:
    return np.reshape(thing["matrix"], (4, 4)).T


# -- the robot ------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["planar3r", "iiwa14", "panda"])
def test_every_visual_stands_where_pinocchio_puts_it(name: str) -> None:
    robot, recorder = Robot.load(name), Recorder()
    viewer = Viewer(robot, transport=recorder)
    geometry = pin.buildGeomFromUrdf(
        robot.model,
        str(robot.source.urdf),
        pin.GeometryType.VISUAL,
        package_dirs=[str(folder) for folder in robot.source.package_dirs],
    )
    data, geometry_data = robot.model.createData(), geometry.createData()
    rng = np.random.default_rng(3)
    for _ in range(5):
        q = robot.random_configuration(rng)
        state = robot.state(0.5, q, rng.standard_normal(robot.nv))
        viewer.show(state if rng.random() < 0.5 else q)
        pin.forwardKinematics(robot.model, data, q)
        pin.updateGeometryPlacements(robot.model, data, geometry, geometry_data)
        for k, item in enumerate(geometry.geometryObjects):
            link, _, number = item.name.rpartition("_")
            joint = robot.model.names[item.parentJoint]
            path = f"/robot/{joint}/{link}"
            thing = children(recorder, path)[int(number)]
            expected = geometry_data.oMg[k].homogeneous
            if type(item.geometry).__name__ == "Cylinder":
                expected = expected @ _Y_TO_Z
            shown = recorder.transform(path) @ matrix(thing)
            np.testing.assert_allclose(shown, expected, atol=1e-12)


def test_the_planar_arm_is_drawn_from_above(arm: Robot, recorder: Recorder) -> None:
    Viewer(arm, transport=recorder)
    links = recorder.paths("/robot/")
    nodes = ("universe/base", "joint1/link1", "joint2/link2", "joint3/link3")
    assert links == [f"/robot/{node}" for node in nodes]
    shapes = [shape for path in links[1:] for shape in geometries(recorder, path)]
    sizes = [s["radius"] for s in shapes if s["type"] == "SphereGeometry"]
    assert sizes == [0.08] * 3  # the point masses
    camera = recorder.command(CAMERA, "camera")
    assert camera is not None
    assert camera["direction"] == [0.0, 0.0, 1.0]
    assert camera["up"] == [0.0, 1.0, 0.0]
    floor = recorder.transform("/floor/shadow")[2, 3]
    assert floor == pytest.approx(-0.12)  # below the stand


def geometries(recorder: Recorder, path: str) -> list[dict[str, Any]]:
    command = recorder.command(path, "object")
    assert command is not None
    return list(command["object"]["geometries"])


def test_a_spatial_arm_is_seen_from_above_its_front_unless_told(
    recorder: Recorder,
) -> None:
    robot = Robot.load("iiwa14")
    Viewer(robot, transport=recorder)
    camera = recorder.command(CAMERA, "camera")
    assert camera is not None
    assert camera["up"] == [0.0, 0.0, 1.0]
    assert camera["direction"][0] > 0.0
    assert camera["direction"][2] > 0.0
    Viewer(robot, transport=recorder, camera=[2, 0, 0.5], target=[0, 0, 0.5])
    camera = recorder.command(CAMERA, "camera")
    assert camera is not None
    assert camera["eye"] == [2.0, 0.0, 0.5]
    assert camera["target"] == [0.0, 0.0, 0.5]
    assert "direction" not in camera


def test_capsules_stand_in_for_missing_meshes(
    recorder: Recorder, caplog: pytest.LogCaptureFixture
) -> None:
    found = Robot.load("panda")
    robot = Robot(found.model, replace(found.source, package_dirs=()))
    viewer = Viewer(robot, transport=recorder)
    assert len(caplog.records) == 1
    assert re.match(
        r"panda: 11 of 11 meshes are not found \(the first belongs to link "
        r"'panda_link0'\).*pip install example-robot-data-loaders",
        caplog.text.partition("robot_drawing.py:")[2].partition(" ")[2],
    )
    joints = [f"/robot/{name}/stand-in" for name in robot.model.names]
    assert recorder.paths("/robot/") == joints
    q = robot.random_configuration(np.random.default_rng(0))
    viewer.show(q)
    state = robot.state(0.0, q, np.zeros(7))
    # The upper arm's capsule ends where the elbow is.
    capsule = children(recorder, "/robot/panda_joint2/stand-in")[-1]
    points = geometries(recorder, "/robot/panda_joint2/stand-in")[-1]["points"]
    axis = [0.0, points[-1]["y"] - points[-1]["x"], 0.0]
    pose = recorder.transform("/robot/panda_joint2") @ matrix(capsule)
    end = pose[:3, :3] @ axis + pose[:3, 3]
    radius = max(point["x"] for point in points)
    elbow = state.data.oMi[3].translation
    assert np.linalg.norm(end - elbow) < radius


def test_a_robot_without_visuals_gets_a_body(
    tmp_path: Path, recorder: Recorder, caplog: pytest.LogCaptureFixture
) -> None:
    text = Robot.load("planar3r").source.urdf.read_text()
    bare = tmp_path / "bare.urdf"
    bare.write_text(re.sub(r"<visual>.*?</visual>", "", text, flags=re.DOTALL))
    Viewer(Robot.load(bare), transport=recorder)
    assert len(recorder.paths("/robot/")) == 4
    assert not caplog.records


def test_two_robots_in_one_workspace_are_both_drawn(recorder: Recorder) -> None:
    beside = pin.SE3(np.eye(3), np.array([0.0, 3.0, 0.0]))
    arm = Robot.load("planar3r")
    robot = Robot.combine({"left": (arm, pin.SE3.Identity()), "right": (arm, beside)})
    Viewer(robot, transport=recorder)
    assert len(recorder.paths("/robot/")) == 8
    base = children(recorder, "/robot/universe/right_base")[0]
    np.testing.assert_allclose(matrix(base)[:3, 3], [0.0, 3.0, -0.11], atol=1e-12)


# -- the run --------------------------------------------------------------------------


def test_paths_target_and_obstacle_follow_the_log(
    arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    viewer = Viewer(arm, transport=recorder)
    viewer.draw_scene(run)
    assert recorder.paths("/paths/") == ["/paths/tip/desired", "/paths/tip/actual"]
    assert recorder.paths("/targets/") == ["/targets/tip"]
    assert recorder.paths("/obstacles/") == ["/obstacles/disk"]
    (disk,) = geometries(recorder, "/obstacles/disk")
    assert (disk["type"], disk["radius"]) == ("SphereGeometry", 0.2)
    desired = recorder.command("/paths/tip/desired", "object")
    assert desired is not None
    points = np.reshape(desired["points"], (-1, 3))[:, :2]
    np.testing.assert_allclose(points, run["task.tip.reference"], atol=1e-6)

    clip = Clip(recorder)
    assert (clip.start, clip.end) == (run.t[0], run.t[-1])
    data = arm.model.createData()
    for row in (0, 37, 150):
        t = run.t[row]
        center = clip.value("/obstacles/disk", "position", t)
        np.testing.assert_allclose(center, run["obstacle.disk"][row], atol=1e-6)
        target = clip.value("/targets/tip", "position", t)[:2]
        np.testing.assert_allclose(target, run["task.tip.reference"][row], atol=1e-6)
        assert clip.value("/paths/tip/actual", "length", t) == pytest.approx(row)
        pin.forwardKinematics(arm.model, data, run.q[row])
        for joint in (1, 2, 3):
            shown = clip.pose(f"/robot/joint{joint}", t)
            expected = data.oMi[joint].homogeneous
            np.testing.assert_allclose(shown, expected, atol=1e-6)
    caption = recorder.command(CAPTION, "caption")
    assert caption is not None
    assert caption["title"] == run.meta["title"]
    assert [entry["name"] for entry in caption["legend"]] == [
        "desired path", "actual path", "disk",
    ]  # fmt: skip


def test_a_state_is_shown_with_what_the_run_did_then(
    arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    viewer = Viewer(arm, transport=recorder)
    viewer.draw_scene(run)
    q = arm.integrate(run.q[37], np.full(3, 0.1))
    viewer.show(arm.state(run.t[37], q, run.v[37]))
    sought = recorder.command(CLIP, "seek")
    assert sought is not None
    assert sought["time"] == run.t[37]
    expected = arm.state(0.0, q, np.zeros(3)).data.oMi[3].homogeneous
    np.testing.assert_array_equal(recorder.transform("/robot/joint3"), expected)
    viewer.draw_scene(Scene())
    assert recorder.command(CLIP, "begin") == {"type": "still", "path": CLIP}
    viewer.show(arm.state(0.25, q, run.v[37]))
    clock = recorder.command(CAPTION, "time")
    assert clock is not None
    assert clock["text"] == "t = 0.25 s"


def test_a_new_scene_replaces_the_old(
    arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    viewer = Viewer(arm, transport=recorder)
    viewer.draw_scene(run)
    ball = Obstacle("ball", Sphere(0.1), UniformLine([1, 0, 0], [0, 2, 0]))
    viewer.draw_scene(Scene([ball]))
    assert recorder.paths("/paths/") == recorder.paths("/targets/") == []
    assert recorder.paths("/obstacles/") == ["/obstacles/ball"]
    viewer.show(arm.state(0.5, arm.home(), np.zeros(3)))
    center = recorder.transform("/obstacles/ball")[:3, 3]
    np.testing.assert_allclose(center, [1.0, 1.0, 0.0], atol=1e-12)


def test_a_pose_task_shows_its_axes(recorder: Recorder) -> None:
    experiment = load_experiment(
        {
            "robot": {"name": "iiwa14"},
            "tasks": {
                "hand": {
                    "type": "frame_pose",
                    "trajectory": {
                        "type": "screw",
                        "position": [0.5, 0.1, 0.5],
                        "rpy": [3.0, 0.2, 0.0],
                        "duration": 0.1,
                    },
                },
            },
            "simulation": {"duration": 0.1},
        }
    )
    rollout = experiment.run()
    viewer = Viewer(experiment.robot, transport=recorder)
    viewer.play(rollout, speed=10.0)
    assert len(children(recorder, "/targets/hand")) == 3
    shown = pin.SE3(Clip(recorder).pose("/targets/hand", 0.1))
    goal = pin.SE3(pin.rpy.rpyToMatrix(3.0, 0.2, 0.0), np.array([0.5, 0.1, 0.5]))
    assert np.linalg.norm(pin.log6(shown.actInv(goal))) < 1e-6


SHAPES: list[Shape] = [
    Sphere(0.1),
    Capsule(0.1, 0.3),
    Cylinder(0.1, 0.3),
    Box((0.1, 0.2, 0.3)),
    HalfSpace(),
    PointCloud([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]),
    HeightField((1.0, 1.0), [[0.0, 0.1], [0.2, 0.0]]),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_every_shape_of_obstacle_is_drawn(
    shape: Shape, arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    viewer = Viewer(arm, transport=recorder)
    viewer.draw_scene(Scene([Obstacle("it", shape, Hold([1.0, 0.0, 0.2]))]))
    live = geometries(recorder, "/obstacles/it")
    reach = shape.reach
    about = {
        "shape": type(shape).__name__,
        "parameters": vars(shape),
        "radius": reach if np.isfinite(reach) else None,
    }
    columns = {**run.columns, "obstacle.it": run["obstacle.disk"]}
    viewer.draw_scene(Rollout(columns, {**run.meta, "obstacles": {"it": about}}))
    again = geometries(recorder, "/obstacles/it")
    assert [thing["type"] for thing in again] == [thing["type"] for thing in live]


def test_a_mesh_is_drawn_and_one_that_is_gone_becomes_a_ball(
    tmp_path: Path, arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    file = tmp_path / "triangle.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\n")
    viewer = Viewer(arm, transport=recorder)
    viewer.draw_scene(Scene([Obstacle("it", Mesh(file), Hold([1.0, 0.0, 0.2]))]))
    (thing,) = geometries(recorder, "/obstacles/it")
    assert len(thing["data"]["attributes"]["position"]["array"]) == 3 * 3 * 3
    about = {"shape": "Mesh", "parameters": {"file": "gone.obj"}, "radius": 0.4}
    columns = {**run.columns, "obstacle.it": run["obstacle.disk"]}
    viewer.draw_scene(Rollout(columns, {**run.meta, "obstacles": {"it": about}}))
    (thing,) = geometries(recorder, "/obstacles/it")
    assert (thing["type"], thing["radius"]) == ("SphereGeometry", 0.4)


# -- playing --------------------------------------------------------------------------


def test_the_page_is_told_how_to_play(
    arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    viewer = Viewer(arm, transport=recorder, speed=0.5)
    viewer.play(run)
    begin = recorder.command(CLIP, "begin")
    assert begin is not None
    assert (begin["play"], begin["loop"], begin["speed"]) == (True, False, 0.5)
    viewer.play(run, speed=3.0, loop=True)
    begin = recorder.command(CLIP, "begin")
    assert begin is not None
    assert (begin["play"], begin["loop"], begin["speed"]) == (True, True, 3.0)


def test_coarse_logs_play_smoothly_and_fine_ones_are_thinned(
    arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    viewer = Viewer(arm, transport=recorder)
    coarse = Rollout({k: v[::10] for k, v in run.columns.items()}, run.meta)
    viewer.draw_scene(coarse)
    clip = Clip(recorder)
    times = clip.times("/robot/joint3", "position")
    assert (times[0], times[-1]) == (coarse.t[0], coarse.t[-1])
    assert np.diff(times).max() < 0.034
    assert np.isin(coarse.t, times).all()
    # Between two rows the links keep their lengths: joints turn, nothing is cut short.
    for t in times:
        places = [clip.value(f"/robot/joint{k}", "position", t) for k in (1, 2, 3)]
        lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
        np.testing.assert_allclose(lengths, 1.0, atol=1e-6)

    fine = motion_of(arm, resampled(run, 4000))
    assert len(fine.times) < 160
    assert (fine.times[0], fine.times[-1]) == (run.t[0], run.t[-1])


def resampled(run: Rollout, rows: int) -> Rollout:
    t = np.linspace(run.t[0], run.t[-1], rows)
    near = np.searchsorted(run.t, t).clip(0, len(run) - 1)
    return Rollout({k: v[near] for k, v in run.columns.items()} | {"t": t}, run.meta)


def test_orientations_between_rows_turn_the_short_way(recorder: Recorder) -> None:
    robot = Robot.load("iiwa14")
    turns = np.array([[0, 0, 0, 1.0], [0, 0, -np.sin(0.2), -np.cos(0.2)]])
    columns = {
        "t": np.array([0.0, 1.0]),
        "q": np.zeros((2, 7)),
        "v": np.zeros((2, 7)),
        "obstacle.box": np.zeros((2, 3)),
        "obstacle.box.quaternion": turns,
    }
    about = {"box": {"shape": "Box", "parameters": {"size": [1, 1, 1]}, "radius": 1}}
    viewer = Viewer(robot, transport=recorder)
    viewer.draw_scene(Rollout(columns, {"status": "completed", "obstacles": about}))
    half = Clip(recorder).value("/obstacles/box", "quaternion", 0.5)
    assert abs(half @ [0, 0, np.sin(0.1), np.cos(0.1)]) == pytest.approx(1.0)


def test_what_cannot_be_played_is_refused(arm: Robot, run: Rollout) -> None:
    viewer = Viewer(arm, transport=Recorder())
    with pytest.raises(ViewerError, match="speed -1 must be positive"):
        viewer.play(run, speed=-1)
    with pytest.raises(ConfigError, match=r"view: camra: .*did you mean 'camera'"):
        Viewer(arm, transport=Recorder(), camra=[1, 2, 3])
    with pytest.raises(ViewerError, match=r"controller is for iiwa14 with nq = 7"):
        viewer.play(run, controller=load_experiment("iiwa_singular").controller)
    empty = Rollout({k: v[:0] for k, v in run.columns.items()}, run.meta)
    with pytest.raises(ViewerError, match="the run is empty"):
        viewer.play(empty)
    other = Viewer(Robot.load("iiwa14"), transport=Recorder())
    with pytest.raises(ViewerError, match=r"of planar3r with nq = 6.*iiwa14 with nq"):
        other.draw_scene(run)


def test_a_log_is_viewed_as_its_configuration_says(
    tmp_path: Path, run: Rollout, recorder: Recorder
) -> None:
    look = {"camera": [0, 0, 9], "speed": 20.0, "show": {"paths": False}}
    config = {**(run.config or {}), "view": look}
    log = Rollout(run.columns, {**run.meta, "config": config})
    path = log.save(tmp_path / "run.npz")
    robot = robot_of(Rollout.load(path))
    assert (robot.name, robot.nq) == ("planar3r", 6)
    assert not robot.model.gravity.linear.any()  # as configured
    viewer = view_logs([path], transport=recorder)
    camera = recorder.command(CAMERA, "camera")
    assert camera is not None
    assert camera["eye"] == [0.0, 0.0, 9.0]
    begin = recorder.command(CLIP, "begin")
    assert begin is not None
    assert begin["speed"] == 20.0
    hidden = recorder.command("/paths", "visible")
    assert hidden is not None
    assert hidden["value"] is False
    assert recorder.command("/targets", "visible") is None
    tip = Clip(recorder).pose("/robot/joint3", run.t[-1]) @ [1.0, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(tip[:2], run["task.tip.actual"][-1], atol=1e-6)
    viewer.close()


def test_a_log_whose_controller_is_gone_shows_what_its_columns_tell(
    tmp_path: Path,
    run: Rollout,
    recorder: Recorder,
    caplog: pytest.LogCaptureFixture,
) -> None:
    config = {**(run.config or {})}
    field = {"type": "point_distance", "frames": ["gone"], "obstacle": "disk"}
    config["null_space"] = {"fields": [field]}
    log = Rollout(run.columns, {**run.meta, "config": config})
    view_logs([log.save(tmp_path / "run.npz")], transport=recorder)
    assert re.search(r"run: only what its columns tell is drawn:.*'gone'", caplog.text)
    assert recorder.paths("/paths/")
    assert not recorder.paths("/distances")


def test_a_log_whose_robot_is_gone_says_so(run: Rollout) -> None:
    anonymous = Rollout(
        run.columns, {k: v for k, v in run.meta.items() if k != "config"}
    )
    with pytest.raises(ViewerError, match=r"made from Python.*'planar3r'.*Viewer\("):
        robot_of(anonymous)
    config = {**(run.config or {}), "robot": {"name": "planar4r"}}
    lost = Rollout(run.columns, {**run.meta, "config": config})
    with pytest.raises(ViewerError, match=r"cannot be found again.*planar4r"):
        robot_of(lost)


# -- the server -----------------------------------------------------------------------


def port_of(url: str | None) -> int:
    assert url is not None
    return int(url.rsplit(":", 1)[1].strip("/"))


def answers(port: int) -> bool:
    with socket.socket() as client:
        client.settimeout(1.0)
        return client.connect_ex(("127.0.0.1", port)) == 0


def gone(pid: int) -> bool:
    """Whether a process is gone, or only waits to be collected."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except FileNotFoundError:
        return True
    return state == "Z"


def wait_until(condition: Any, timeout: float = 8.0) -> bool:
    deadline = time.monotonic() + timeout
    while not condition() and time.monotonic() < deadline:
        time.sleep(0.05)
    return bool(condition())


@LINUX
def test_it_listens_on_the_loopback_address_alone(started: Server) -> None:
    pid = started.process.pid
    links = [str(link.readlink()) for link in Path(f"/proc/{pid}/fd").iterdir()]
    inodes = {link[8:-1] for link in links if link.startswith("socket:[")}
    listening = []
    for table in ("tcp", "tcp6", "udp", "udp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[9] in inodes:
                listening.append((table, fields[1]))
    port = port_of(started.url)
    assert listening == [("tcp", f"0100007F:{port:04X}")]  # 127.0.0.1, and only there


def test_closing_leaves_nothing(arm: Robot) -> None:
    with Viewer(arm) as viewer:
        port = port_of(viewer.url)
        assert answers(port)
        viewer.show(arm.home())
    assert isinstance(viewer.transport, Server)
    assert viewer.transport.process.returncode is not None
    assert not answers(port)
    viewer.close()  # again is no error
    with pytest.raises(ViewerError, match="the viewer is closed"):
        viewer.show(arm.home())


PARENT = """
import os, sys, time
from hsp_control.visualization.viewer.server import Server
server = Server()
if sys.argv[1] == "fork" and os.fork() == 0:
    os.close(1)
    time.sleep(30)  # holds the server's input open after its parent's death
    os._exit(0)
print(server.process.pid, server.url, flush=True)
if sys.argv[1] == "exit":
    sys.exit()
time.sleep(60)
"""


ENDS = {
    "exit": None,
    "terminate": signal.SIGTERM,
    "hang up": signal.SIGHUP,
    "crash": signal.SIGSEGV,
    "kill": signal.SIGKILL,
    "fork": signal.SIGKILL,
}


@LINUX
def test_it_ends_with_its_parent_however_that_ends() -> None:
    with ExitStack() as stack:
        parents = []
        for end in ENDS:  # side by side: each imports Pinocchio first
            command = [sys.executable, "-c", PARENT, end]
            parent = subprocess.Popen(
                command, stdout=subprocess.PIPE, text=True, start_new_session=True
            )
            stack.enter_context(parent)
            stack.callback(end_group, parent.pid)
            parents.append(parent)
        for parent, sign in zip(parents, ENDS.values(), strict=True):
            assert parent.stdout is not None
            pid, url = parent.stdout.readline().split()
            if sign is not None:
                assert answers(port_of(url))
                parent.send_signal(sign)
            parent.wait(10)
            deadline = time.monotonic() + 8.0
            while not gone(int(pid)) and time.monotonic() < deadline:
                time.sleep(0.05)
            assert gone(int(pid))


def end_group(leader: int) -> None:
    with suppress(ProcessLookupError):
        os.killpg(leader, signal.SIGKILL)


def test_two_viewers_have_two_addresses(started: Server) -> None:
    other = Server()
    try:
        assert other.url != started.url
        assert answers(port_of(started.url))
        assert answers(port_of(other.url))
        port = port_of(started.url)
        with pytest.raises(ViewerError, match=rf"cannot listen on 127\.0\.0\.1:{port}"):
            Server(port)
        with pytest.raises(ViewerError, match="port 70000 is not between"):
            Server(70000)
    finally:
        other.close()


@LINUX
def test_without_a_browser_nothing_waits(
    arm: Robot, run: Rollout, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin = time.monotonic()
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    with Viewer(arm, open_browser=True) as viewer:
        viewer.play(run)
        for _ in range(5000):  # more than any pipe holds
            viewer.show(arm.home())
        assert not viewer.wait_for_browser(0.0)
    assert time.monotonic() - begin < 10.0


def test_it_is_known_when_the_last_page_is_closed(
    arm: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "RELOAD_TIMEOUT", 0.7)
    with Viewer(arm) as viewer:
        assert viewer.url is not None
        page = Page(viewer.url)
        assert viewer.wait_for_browser(8.0)
        waiting = threading.Thread(target=viewer.wait_until_closed, daemon=True)
        waiting.start()
        waiting.join(1.5)
        assert waiting.is_alive()
        page.leave()
        waiting.join(8.0)
        assert not waiting.is_alive()


def test_a_notebook_shows_the_page_in_a_frame(arm: Robot, recorder: Recorder) -> None:
    with Viewer(arm) as viewer:
        assert f'<iframe src="{viewer.url}"' in viewer._repr_html_()
    assert "it has no page" in Viewer(arm, transport=recorder)._repr_html_()


def test_a_dead_or_stopped_server_is_an_error_not_a_wait(
    arm: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "STALL_TIMEOUT", 0.3)
    for sign, message in ((signal.SIGKILL, "has ended"), (signal.SIGSTOP, "for 0.3 s")):
        viewer = Viewer(arm)
        assert isinstance(viewer.transport, Server)
        viewer.transport.process.send_signal(sign)
        begin = time.monotonic()
        with pytest.raises(ViewerError, match=message):
            show_for(viewer, 8.0)
        assert time.monotonic() < begin + 5.0
        assert viewer.transport.process.returncode is not None


def show_for(viewer: Viewer, seconds: float) -> None:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        viewer.show(viewer.robot.home())


def test_a_page_that_opens_late_sees_everything(arm: Robot, run: Rollout) -> None:
    with Viewer(arm) as viewer:
        assert viewer.url is not None
        viewer.draw_scene(run)
        viewer.show(arm.home())
        viewer.transport.send([])
        first = Page(viewer.url)
        assert viewer.wait_for_browser(8.0)
        kinds = [(command["type"], command.get("path")) for command in first.commands]
        assert ("set_object", "/robot/joint3/link3") in kinds
        assert ("trail", "/paths/tip/desired") in kinds
        assert ("clip", CLIP) in kinds
        assert ("camera", CAMERA) in kinds
        assert len(kinds) == len(set(kinds)) + 1  # the background's two colours
        viewer.draw_scene(Scene())
        second = Page(viewer.url)
        assert viewer.wait_for_browser(8.0)
        assert wait_until(lambda: second.commands and first.commands[-1] == {
            **second.commands[-1]})  # fmt: skip
        assert ("delete", "/paths") in [
            (c["type"], c.get("path")) for c in first.commands
        ]
        paths = [command.get("path", "") for command in second.commands]
        assert not any(path.startswith("/paths") for path in paths)
    first.join(5.0)
    second.join(5.0)


def test_a_slow_page_skips_what_is_out_of_date(arm: Robot) -> None:
    with Viewer(arm) as viewer:
        assert viewer.url is not None
        page = Page(viewer.url, pause=0.1)
        assert viewer.wait_for_browser(8.0)
        before = len(page.commands)
        q = arm.home()
        for angle in np.linspace(0.0, 1.0, 400):
            q = arm.integrate(arm.neutral(), np.full(3, angle))
            viewer.show(q)
            time.sleep(1e-3)
        assert viewer.wait_for_browser(8.0)
        moves = [c for c in page.commands[before:] if c["type"] == "set_transform"]
        assert len(moves) < 3 * 100  # of 400 moves of three joints
        last = page.last("set_transform", "/robot/joint1")["matrix"]
        expected = arm.state(0.0, q, np.zeros(3)).data.oMi[1].homogeneous
        np.testing.assert_array_equal(
            np.frombuffer(last.data).reshape(4, 4).T, expected
        )


def test_its_files_are_for_this_machine_alone(started: Server) -> None:
    assert started.url is not None
    for file, text in (
        ("", "connect();"),
        ("page.js", "MeshCat"),
        ("player.js", "class Player"),
        ("player.css", ".player"),
        ("main.min.js", ""),
    ):
        with urllib.request.urlopen(started.url + file) as answer:
            assert text in answer.read().decode()
    for path, headers in (
        ("nothing", {}),
        ("../server.py", {}),
        ("", {"Host": "evil.example"}),
    ):
        request = urllib.request.Request(started.url + path, headers=headers)
        with pytest.raises(urllib.error.HTTPError) as refused:
            urllib.request.urlopen(request)
        refused.value.close()
        assert refused.value.code == (403 if headers else 404)

    handshake = {
        "Upgrade": "websocket",
        "Connection": "Upgrade",
        "Sec-WebSocket-Version": "13",
        "Sec-WebSocket-Key": "dGhlIHNhbXBsZSBub25jZQ==",
    }
    for origin, status in (("http://evil.example", 403), (started.url[:-1], 101)):
        connection = HTTPConnection("127.0.0.1", port_of(started.url))
        connection.request("GET", "/scene", headers={**handshake, "Origin": origin})
        with connection.getresponse() as answer:
            assert answer.status == status
        connection.close()


def test_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(server.importlib.util, "find_spec", lambda name: None)
    with pytest.raises(ViewerError, match="pip install meshcat"):
        Server()


def test_a_server_that_cannot_start_says_why(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(server, "meshcat_page", lambda: tmp_path)
    with pytest.raises(ViewerError, match=r"cannot start: .*main\.min\.js"):
        Server()
    monkeypatch.setattr(server.sys, "executable", "/bin/false")
    with pytest.raises(ViewerError, match="has ended"):
        Server()


def test_a_browser_is_opened_only_where_there_is_one(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    url, opened = "http://127.0.0.1:7000/", threading.Event()
    monkeypatch.setattr(browser.webbrowser, "open", lambda url, new: opened.set())
    monkeypatch.setattr(browser.sys, "platform", "linux")
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    assert not browser.open_browser(url)
    assert f"no display to open a browser on; the view is at {url}" in caplog.text
    monkeypatch.setenv("DISPLAY", ":0")
    terminal = webbrowser.GenericBrowser("w3m")
    monkeypatch.setattr(browser.webbrowser, "get", lambda: terminal)
    assert not browser.open_browser(url)
    assert "w3m would take over the terminal" in caplog.text
    assert not opened.is_set()
    graphical = webbrowser.BackgroundBrowser("firefox")
    monkeypatch.setattr(browser.webbrowser, "get", lambda: graphical)
    assert browser.open_browser(url)
    assert opened.wait(5.0)


# -- its parts ------------------------------------------------------------------------


def test_the_newest_word_counts_and_order_is_kept() -> None:
    kept = Kept()
    for key, word in (("/a", b"1"), ("/a/b", b"2"), ("/ab", b"3"), ("/a", b"4")):
        kept.put(key_of(key, "object"), word)
    assert kept.copy().take() == [b"2", b"3", b"4"]
    kept.drop("/a")
    assert [item[0] for item in kept.items()] == ["/ab"]


def test_records_survive_being_cut_anywhere() -> None:
    records = [Record(SET, "/ä", b"x" * 300), Record(DELETE, "", b"")] * 3
    data = b"".join(map(encode, records))
    for size in (1, 7, 310, len(data)):
        decoder = Decoder()
        found = [
            record
            for start in range(0, len(data), size)
            for record in decoder.feed(data[start : start + size])
        ]
        assert found == records


def test_importing_the_package_pulls_in_no_viewer_and_that_no_meshcat() -> None:
    code = """if True:
        import sys, hsp_control
        print(*sys.modules)
        import hsp_control.visualization.viewer
        print(*sys.modules)
    """
    run = [sys.executable, "-c", code]
    printed = subprocess.run(run, capture_output=True, text=True, check=True).stdout
    package, viewer = (set(line.split()) for line in printed.splitlines())
    assert not {"tornado", "umsgpack", "hsp_control.visualization.viewer"} & package
    assert not {"meshcat", "tornado", "zmq", "IPython", "matplotlib"} & viewer


def test_nothing_is_printed(capfd: pytest.CaptureFixture[str], arm: Robot) -> None:
    logging.getLogger("hsp_control").handlers.clear()
    with Viewer(arm) as viewer:
        viewer.show(arm.home())
    captured = capfd.readouterr()
    assert (captured.out, captured.err) == ("", "")
