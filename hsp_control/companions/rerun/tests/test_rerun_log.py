"""A run in a Rerun file, read back: the same names and numbers as in our view."""

import builtins
from collections.abc import Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import mujoco
import numpy as np
import pytest
import rerun
from rerun.chunk import RrdReader

import hsp_control as hsp
from hsp_control import Robot
from hsp_control.cli import main
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ExportError
from hsp_control.companions.rerun.log import (
    _archetypes,
    _layout,
    _log_paths,
    _log_robot,
    _mesh,
    log_to_rerun,
)
from hsp_control.companions.viewer.commands import path_element
from hsp_control.companions.viewer.motion import RunMotion
from hsp_control.companions.viewer.robot_drawing import read_visuals
from hsp_control.companions.viewer.targets import read_targets


@pytest.fixture(scope="module")
def experiment() -> hsp.Experiment:
    return hsp.load_experiment("panda_obstacle", "simulation.duration=0.5")


@pytest.fixture(scope="module")
def log(experiment: hsp.Experiment) -> hsp.Rollout:
    return experiment.run()


@pytest.fixture(scope="module")
def written(
    log: hsp.Rollout, tmp_path_factory: pytest.TempPathFactory
) -> Mapping[str, Any]:
    """The file's chunks by path: those with rows, otherwise static ones."""
    path = tmp_path_factory.mktemp("rerun") / "run.rrd"
    log_to_rerun(log, path=path)
    chunks = sorted(RrdReader(path).stream(), key=lambda chunk: not chunk.is_static)
    return {chunk.entity_path: chunk for chunk in chunks}


def column(chunk: Any, name: str) -> Array:
    rows = chunk.to_record_batch().column(name).to_pylist()
    return np.array([np.ravel(row) for row in rows])


def test_the_scene_has_the_names_and_poses_of_our_view(
    written: Mapping[str, Any], experiment: hsp.Experiment, log: hsp.Rollout
) -> None:
    chunk = written["/robot/panda_joint4"]
    assert chunk.num_rows == len(log)
    row = 37
    state = experiment.robot.state(log.t[row], log.q[row], log.v[row])
    place = state.data.oMi[4]
    where = column(chunk, "Transform3D:translation")[row]
    np.testing.assert_allclose(where, place.translation, atol=1e-6)
    x, y, z, w = column(chunk, "Transform3D:quaternion")[row]
    turned = np.array(
        [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)]
    )
    np.testing.assert_allclose(turned, place.rotation[:, 0], atol=1e-6)
    times = chunk.to_record_batch().column("t").to_pylist()
    assert times[row].total_seconds() == pytest.approx(log.t[row])
    ball = column(written["/obstacles/ball"], "Transform3D:translation")
    np.testing.assert_allclose(ball, log["obstacle.ball"], atol=1e-6)
    target = column(written["/targets/hand"], "Transform3D:translation")
    np.testing.assert_allclose(target, log["task.hand.reference"][:, :3], atol=1e-6)
    assert {"/paths/hand/desired", "/paths/hand/actual"} <= set(written)
    meshes = [
        path for path in written if path.startswith("/robot/panda_joint4/panda_l")
    ]
    assert any("Mesh3D" in " ".join(written[m].to_record_batch().schema.names)
               for m in meshes)  # fmt: skip


def test_it_goes_where_others_log(log: hsp.Rollout, tmp_path: Path) -> None:
    """Into a recording that is already open, with another robot object."""
    path = tmp_path / "shared.rrd"
    recording = rerun.RecordingStream("theirs")
    recording.save(str(path))
    recording.log("/theirs", rerun.Points3D([[0.0, 0.0, 1.0]]), static=True)
    same = log_to_rerun(log, hsp.Robot.load("panda"), recording=recording)
    assert same is recording
    recording.disconnect()
    paths = {chunk.entity_path for chunk in RrdReader(path).stream()}
    assert {"/theirs", "/robot/panda_joint1"} <= paths


def test_other_shapes_and_links_without_meshes(tmp_path: Path) -> None:
    robot = hsp.Robot.load("planar3r")
    shapes = hsp.shapes
    scene = [
        hsp.Obstacle("box", shapes.Box([0.1, 0.2, 0.3]), hsp.Hold([1.0, 0.0, 0.0])),
        hsp.Obstacle("pipe", shapes.Cylinder(0.1, 0.5), hsp.Hold([1.0, 1.0, 0.0])),
        hsp.Obstacle("pill", shapes.Capsule(0.1, 0.5), hsp.Hold([1.0, 1.0, 1.0])),
        hsp.Obstacle("floor", shapes.HalfSpace(), hsp.Hold([0.0, 0.0, -1.0])),
    ]
    controller = hsp.Controller(robot, [hsp.JointPosture()], scene=scene)
    log = hsp.simulate(controller, robot.home(), duration=0.02)
    path = tmp_path / "run.rrd"
    log_to_rerun(log, robot, path=path)
    drawn = {
        chunk.entity_path: " ".join(chunk.to_record_batch().schema.names)
        for chunk in RrdReader(path).stream()
        if chunk.is_static
    }
    assert "Boxes3D" in drawn["/obstacles/box"]
    assert "Cylinders3D" in drawn["/obstacles/pipe"]
    assert "Capsules3D" in drawn["/obstacles/pill"]
    assert "/obstacles/floor" not in drawn  # it has no end
    assert any("robot/joint2" in path for path in drawn)


def test_the_command_writes_it(
    log: hsp.Rollout, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    saved = log.save(tmp_path / "run.npz")
    path = tmp_path / "run.rrd"
    assert main(["export", str(saved), "--rrd", str(path)]) == 0
    assert "MB: " in capsys.readouterr().out
    assert any(
        c.entity_path == "/log/null_space_norm" for c in RrdReader(path).stream()
    )
    assert main(["export", str(saved), "--rrd", "run.html"]) == 2
    assert "the name must end with .rrd" in capsys.readouterr().err
    assert main(["export", str(saved), str(saved), "--rrd", str(path)]) == 2
    assert "a file of Rerun shows one run" in capsys.readouterr().err


def test_missing_parts_are_reported(
    log: hsp.Rollout, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(ExportError, match="either a recording or a path"):
        log_to_rerun(log, recording=object(), path="run.rrd")
    with pytest.raises(ExportError, match=r"nowhere/run\.rrd: No such file"):
        log_to_rerun(log, path=tmp_path / "nowhere" / "run.rrd")
    real = builtins.__import__

    def without(name: str, *arguments: Any) -> Any:
        if name == "rerun":
            raise ImportError(name)
        return real(name, *arguments)

    monkeypatch.setattr(builtins, "__import__", without)
    with pytest.raises(ExportError, match=r"pip install 'hsp_control\[rerun\]'"):
        log_to_rerun(log)


def test_every_kind_of_geom_is_drawn() -> None:
    sizes = {
        "sphere": ".1",
        "capsule": ".05 .1",
        "cylinder": ".05 .1",
        "box": ".05 .1 .15",
        "ellipsoid": ".15 .05 .1",
    }
    geoms = [f"type='{kind}' size='{size}'" for kind, size in sizes.items()]
    drawn = []
    for geom in [*geoms, "type='mesh' mesh='wedge'"]:
        model = mujoco.MjModel.from_xml_string(f"""<mujoco>
          <asset><mesh name="wedge" vertex="0 0 0  .2 0 0  0 .1 0  0 0 .15"/></asset>
          <worldbody><body name="a"><joint axis="0 1 0"/><geom {geom}/></body>
          </worldbody></mujoco>""")
        visual = read_visuals(Robot.from_mujoco(model))[0]
        (archetype,) = _archetypes(rerun, visual, "a")
        drawn.append(type(archetype).__name__)
    assert drawn == [
        "Ellipsoids3D",
        "Capsules3D",
        "Cylinders3D",
        "Boxes3D",
        "Ellipsoids3D",
        "Mesh3D",
    ]


def test_rotations_are_the_same(log: hsp.Rollout) -> None:
    """A link's shape in its joint, and the target of an orientation."""
    robot = hsp.Robot.load("panda")
    sent: dict[str, Any] = {}

    class Recording:
        def log(self, path: str, thing: Any, **_: Any) -> None:
            sent[path] = thing

        def send_columns(self, path: str, _: Any, columns: Any) -> None:
            sent[path] = columns

    class Rerun:
        """Records its arguments."""

        class Transform3D(dict[str, Any]):
            @staticmethod
            def columns(**given: Any) -> Any:
                return given

        def __getattr__(self, kind: str) -> Any:
            return lambda *_, **__: kind

    motion = RunMotion(robot, log)
    _log_robot(Rerun(), Recording(), motion)
    turned = 0
    for k, visual in enumerate(read_visuals(robot)):
        ends = f"/{path_element(visual.link)}/{k}"
        (pose,) = (thing for path, thing in sent.items() if path.endswith(ends))
        np.testing.assert_array_equal(pose["mat3x3"], visual.pose[:3, :3])
        np.testing.assert_array_equal(pose["translation"], visual.pose[:3, 3])
        turned += not np.allclose(visual.pose[:3, :3], visual.pose[:3, :3].T)
    assert turned
    _log_paths(Rerun(), Recording(), motion)
    (target,) = (t for t in read_targets(motion.rows) if t.name == "hand")
    assert target.rotation is not None
    given = sent["/targets/hand"]["quaternion"]
    np.testing.assert_array_equal(given, target.rotation)


def test_plots_beside_the_scene_are_of_the_columns_that_they_name(
    log: hsp.Rollout,
) -> None:
    _, plots = _layout(log).root_container.contents
    assert {each.name: each.contents for each in plots.contents} == {
        "Task errors": ["+ /log/task.hand.error/**"],
        "Null-space error ‖e_N‖": ["+ /log/null_space_norm/**"],
        "Distances": ["+ /log/distance.obstacle_clearance/**"],
        "Efforts": ["+ /log/tau/**"],
    }


def test_a_desired_path_has_the_colour_of_its_target(log: hsp.Rollout) -> None:
    colors = dict[str, Any]()

    class Recording:
        def log(self, path: str, thing: Any, **_: Any) -> None:
            colors[path] = thing.colors.as_arrow_array().to_pylist()

        def send_columns(self, *_: Any) -> None:
            pass

    _log_paths(rerun, Recording(), RunMotion(Robot.load("panda"), log))
    assert colors["/paths/hand/desired"] == colors["/targets/hand"]
    assert colors["/paths/hand/actual"] != colors["/targets/hand"]


def test_a_file_is_complete_though_its_recording_is_still_there(
    log: hsp.Rollout, tmp_path: Path
) -> None:
    path = tmp_path / "run.rrd"
    recording = log_to_rerun(log, path=path)
    paths = {chunk.entity_path for chunk in RrdReader(path).stream()}
    assert {f"/log/{name}" for name in ("null_space_norm", "status")} <= paths
    del recording


def test_normals_of_a_mesh_point_outwards() -> None:
    corners = np.array([[0.0, 0.0, 0.0], *np.eye(3)])
    faces = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    drawn = _mesh(SimpleNamespace(Mesh3D=dict), corners, faces, None)
    outwards = corners - corners.mean(axis=0)
    assert ((drawn["vertex_normals"] * outwards).sum(axis=1) > 0.0).all()
