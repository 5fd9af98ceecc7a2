"""The view shows all objects at their poses, and plays logs."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from clips import Clip, Recorder, reported
from robot_texts import joint as joint_text
from robot_texts import link, robot_xml

from hsp_control import Obstacle, Robot, Rollout, load_experiment
from hsp_control.common.errors import ViewerError
from hsp_control.companions.viewer import Viewer, robot_of, stage, view_logs
from hsp_control.companions.viewer.commands import CAMERA, CAPTION, CLIP, unpack
from hsp_control.companions.viewer.mesh_files import with_files
from hsp_control.companions.viewer.motion import motion_of
from hsp_control.companions.viewer.robot_drawing import RobotDrawing
from hsp_control.companions.viewer.threejs import _Y_TO_Z
from hsp_control.companions.viewer.transport import SceneRecorder
from hsp_control.geometry import Scene, shapes
from hsp_control.trajectories import Hold


def children(recorder: Recorder, path: str) -> list[dict[str, Any]]:
    command = reported(recorder, path, "object")
    return list(command["object"]["object"]["children"])


def matrix(thing: dict[str, Any]) -> np.ndarray:
    return np.reshape(thing["matrix"], (4, 4)).T


# --- the robot -----------------------------------------------------------------------


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


def geometries(recorder: Recorder, path: str) -> list[dict[str, Any]]:
    command = reported(recorder, path, "object")
    return list(command["object"]["geometries"])


def test_a_robot_without_visuals_gets_a_body(
    tmp_path: Path, recorder: Recorder, caplog: pytest.LogCaptureFixture
) -> None:
    text = Robot.load("planar3r").source.urdf.read_text()
    bare = tmp_path / "bare.urdf"
    bare.write_text(re.sub(r"<visual>.*?</visual>", "", text, flags=re.DOTALL))
    Viewer(Robot.load(bare), transport=recorder)
    assert len(recorder.paths("/robot/")) == 4
    assert not caplog.records


# --- the run -------------------------------------------------------------------------


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
    desired = reported(recorder, "/paths/tip/desired", "object")
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
    caption = reported(recorder, CAPTION, "caption")
    assert caption["title"] == run.meta["title"]
    assert [entry["name"] for entry in caption["legend"]] == [
        "desired path", "actual path", "target", "obstacle disk", "manipulability",
        "Frame axes: tip", "robot", "grid", "shadow",
    ]  # fmt: skip
    rows = {entry["name"]: entry for entry in caption["legend"]}
    assert rows["actual path"]["paths"] == ["/paths/tip/actual"]
    assert rows["obstacle disk"]["paths"] == ["/obstacles"]
    assert [name for name, row in rows.items() if not row["shown"]] == [
        "manipulability", "Frame axes: tip",
    ]  # fmt: skip


def test_a_state_is_shown_with_its_row_of_the_run(
    arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    viewer = Viewer(arm, transport=recorder)
    viewer.draw_scene(run)
    q = arm.integrate(run.q[37], np.full(3, 0.1))
    viewer.show(arm.state(run.t[37], q, run.v[37]))
    sought = reported(recorder, CLIP, "seek")
    assert sought["time"] == run.t[37]
    expected = arm.state(0.0, q, np.zeros(3)).data.oMi[3].homogeneous
    np.testing.assert_array_equal(recorder.transform("/robot/joint3"), expected)
    viewer.draw_scene(Scene())
    assert recorder.command(CLIP, "begin") == {"type": "still", "path": CLIP}
    viewer.show(arm.state(0.25, q, run.v[37]))
    clock = reported(recorder, CAPTION, "time")
    assert clock["text"] == "t = 0.25 s"


@pytest.mark.parametrize(("axis", "eye"), [
    ("0 0 1", [0, 0, 1]), ("0 0 -1", [0, 0, 1]),
    ("0 1 0", [0, -1, 0]), ("0 -1 0", [0, -1, 0]),
    ("1 0 0", [1, 0, 0]), ("-1 0 0", [1, 0, 0]),
])  # fmt: skip
def test_a_planar_arm_is_seen_from_above_or_with_its_x_or_y_to_the_right(
    axis: str, eye: list[float], tmp_path: Path
) -> None:
    level = joint_text("a", "base", "one").replace(' rpy="0.3 0.2 0.1"', "")
    turning = level.replace('axis xyz="0 0 1"', f'axis xyz="{axis}"')
    urdf = tmp_path / "planar.urdf"
    urdf.write_text(robot_xml(link("base"), link("one"), turning))
    np.testing.assert_array_equal(stage.plane_normal(Robot.load(urdf)), eye)


SHAPES: list[shapes.Shape] = [
    shapes.Sphere(0.1),
    shapes.Capsule(0.1, 0.3),
    shapes.Cylinder(0.1, 0.3),
    shapes.Box((0.1, 0.2, 0.3)),
    shapes.HalfSpace(),
    shapes.PointCloud([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]]),
    shapes.HeightField((1.0, 1.0), [[0.0, 0.1], [0.2, 0.0]]),
]


def nameless(things: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return geometries without the names that each drawing gives them."""
    return [{k: v for k, v in each.items() if k != "uuid"} for each in things]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_every_shape_of_obstacle_is_drawn(
    shape: shapes.Shape, arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    viewer = Viewer(arm, transport=recorder)
    viewer.draw_scene(Scene([Obstacle("it", shape, Hold([1.0, 0.0, 0.2]))]))
    live = geometries(recorder, "/obstacles/it")
    reach = shape.bounding_radius
    about = {
        "shape": type(shape).__name__,
        "parameters": vars(shape),
        "radius": reach if np.isfinite(reach) else None,
    }
    columns = {**run.columns, "obstacle.it": run["obstacle.disk"]}
    viewer.draw_scene(Rollout(columns, {**run.meta, "obstacles": {"it": about}}))
    again = geometries(recorder, "/obstacles/it")
    assert live
    if isinstance(shape, shapes.HalfSpace):  # as large as the scene, or the whole run
        assert [each["type"] for each in again] == [each["type"] for each in live]
        return
    np.testing.assert_equal(nameless(again), nameless(live))


def test_a_mesh_is_drawn_and_one_that_is_gone_becomes_a_ball(
    tmp_path: Path, arm: Robot, run: Rollout, recorder: Recorder
) -> None:
    file = tmp_path / "triangle.obj"
    file.write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\nf 1 3 4\n")
    viewer = Viewer(arm, transport=recorder)
    viewer.draw_scene(Scene([Obstacle("it", shapes.Mesh(file), Hold([1.0, 0.0, 0.2]))]))
    (thing,) = geometries(recorder, "/obstacles/it")
    assert len(thing["data"]["attributes"]["position"]["array"]) == 3 * 3 * 3
    about = {"shape": "Mesh", "parameters": {"file": "gone.obj"}, "radius": 0.4}
    columns = {**run.columns, "obstacle.it": run["obstacle.disk"]}
    viewer.draw_scene(Rollout(columns, {**run.meta, "obstacles": {"it": about}}))
    (thing,) = geometries(recorder, "/obstacles/it")
    assert (thing["type"], thing["radius"]) == ("SphereGeometry", 0.4)


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
    # Between two rows the links keep their lengths: joints rotate along arcs.
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


def test_unplayable_sources_are_refused(arm: Robot, run: Rollout) -> None:
    viewer = Viewer(arm, transport=Recorder())
    with pytest.raises(ViewerError, match="speed is -1; must be positive"):
        viewer.play(run, speed=-1)
    with pytest.raises(ViewerError, match=r"ings: camra: .*did you mean 'camera'"):
        Viewer(arm, transport=Recorder(), camra=[1, 2, 3])
    with pytest.raises(ViewerError, match=r"controller is for iiwa14 with nq = 7"):
        viewer.play(run, controller=load_experiment("iiwa_singular").controller)
    empty = Rollout({k: v[:0] for k, v in run.columns.items()}, run.meta)
    with pytest.raises(ViewerError, match="the run is empty"):
        viewer.play(empty)
    other = Viewer(Robot.load("iiwa14"), transport=Recorder())
    with pytest.raises(ViewerError, match=r"of planar3r with nq = 6.*iiwa14 with nq"):
        other.draw_scene(run)


def test_a_log_is_viewed_as_configured(
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
    camera = reported(recorder, CAMERA, "camera")
    assert camera["eye"] == [0.0, 0.0, 9.0]
    begin = reported(recorder, CLIP, "begin")
    assert begin["speed"] == 20.0
    hidden = reported(recorder, "/paths/tip/actual", "visible")
    assert hidden["value"] is False
    assert recorder.command("/targets", "visible") is None
    tip = Clip(recorder).pose("/robot/joint3", run.t[-1]) @ [1.0, 0.0, 0.0, 1.0]
    np.testing.assert_allclose(tip[:2], run["task.tip.actual"][-1], atol=1e-6)
    viewer.close()


def test_a_log_without_its_controller_is_drawn_from_columns(
    tmp_path: Path, run: Rollout, recorder: Recorder, caplog: pytest.LogCaptureFixture
) -> None:
    config = {**(run.config or {})}
    field = {"type": "point_distance", "frames": ["gone"], "obstacle": "disk"}
    config["null_space"] = {"fields": [field]}
    log = Rollout(run.columns, {**run.meta, "config": config})
    view_logs([log.save(tmp_path / "run.npz")], transport=recorder)
    assert re.search(
        r"run: no controller, only the log's columns are drawn:.*'gone'", caplog.text
    )
    assert recorder.paths("/paths/")
    assert not recorder.paths("/distances")


def test_a_log_without_its_robot_is_refused(run: Rollout) -> None:
    robot = {k: v for k, v in run.meta["robot"].items() if k != "record"}
    meta = {**run.meta, "robot": robot}
    anonymous = Rollout(run.columns, {k: v for k, v in meta.items() if k != "config"})
    with pytest.raises(ViewerError, match=r"made from Python.*'planar3r'.*Viewer\("):
        robot_of(anonymous)
    config = {**(run.config or {}), "robot": {"name": "planar4r"}}
    lost = Rollout(run.columns, {**meta, "config": config})
    with pytest.raises(ViewerError, match=r"cannot be rebuilt.*planar4r"):
        robot_of(lost)


def from_files(command: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the parts of an object that are drawn from mesh files."""
    if command["type"] != "set_object":
        return []
    thing = command["object"]
    things = [*thing.get("geometries", []), thing["object"]]
    things += thing["object"].get("children", [])
    return [each for each in things if "file" in each]


def test_a_mesh_file_is_sent_once_and_before_its_objects() -> None:
    robot, recorder = load_experiment("dual_panda").robot, SceneRecorder()
    Viewer(robot, transport=recorder)
    one = SceneRecorder()
    Viewer(Robot.load("panda"), transport=one)
    recorder.send(RobotDrawing(robot, "/again").draw())  # as of a second run
    commands = [unpack(packed) for *_, packed in recorder.scene.items()]
    known: set[str] = set()
    for command in commands:
        if command["type"] == "mesh_file":
            assert command["file"] not in known
            known.add(command["file"])
        assert {each["file"] for each in from_files(command)} <= known
    other = [unpack(packed) for *_, packed in one.scene.items()]
    files = {each["file"] for each in other if each["type"] == "mesh_file"}
    assert known == files
    # An export has them in place of their names.
    shown = [*with_files(commands)]
    assert not any(command["type"] == "mesh_file" for command in shown)
    drawn = [each for command in shown for each in from_files(command)]
    assert len(drawn) > 2 * len(known)
    assert all("data" in each for each in drawn)
