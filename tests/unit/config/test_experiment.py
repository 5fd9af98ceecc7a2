"""YAML and Python make the same objects, and every error names its place."""

import json
import re
from pathlib import Path

import jsonschema
import numpy as np
import pytest
import yaml
from exported_schema import exported_schema, validator
from scenario_document import check_place
from wording import wording

from hsp_control import (
    FramePose,
    JointCentering,
    Rollout,
    integrators,
    load_experiment,
    metrics,
)
from hsp_control.common import errors
from hsp_control.common.resources import bundled_configs

MOVING = "paper/4_moving_obstacle"

PANDA = {
    "robot": {"name": "panda",
     "tool_frames": {"pen": {"parent": "panda_hand", "translation": [0, 0, 0.2]}}},
    "start": {"joints": {"panda_joint4": -2.0}},
    "tasks": {"pen": {"type": "frame_pose", "frame": "pen", "blend": 0.5,
        "gains": {"natural_frequency": [8, 8, 8, 5, 5, 5], "damping_ratio": 0.9},
        "trajectory": {"type": "composed", "position": {"type": "circle",
              "origin": "start", "center": [0, 0, 0], "radius": 0.05,
              "angular_rate": 2, "normal": [0, 0, 1]}}}},
    "null_space": {"gain": 6, "metric": {"type": "mass_matrix"},
     "fields": [{"type": "joint_centering", "weight": 2.0}]},
    "simulation": {"duration": 0.02, "control_period": 0.001,
     "integrator": {"type": "rk4", "step": 0.0005}},
}  # fmt: skip


def changed(path: str, value: object) -> dict:
    """Return the Panda's configuration with one value changed, made or removed."""
    data = json.loads(json.dumps(PANDA))
    *keys, last = path.split(".")
    place = data
    for key in keys:
        place = place[int(key) if isinstance(place, list) else key]
    if isinstance(place, list):
        place[int(last)] = value
    else:
        place[last] = value
    return data


@pytest.mark.slow
def test_every_bundled_configuration_follows_the_exported_schema() -> None:
    jsonschema.Draft202012Validator.check_schema(exported_schema())
    for name, file in bundled_configs().items():
        data = yaml.safe_load(file.read_text(encoding="utf-8"))
        validator().validate(data)
        assert data["title"], name


def test_a_configuration_becomes_the_objects_it_names() -> None:
    experiment = load_experiment(PANDA)
    (task,) = experiment.controller.tasks
    assert isinstance(task, FramePose)
    assert task.name == task.frame == "pen"
    Kp, Kv, offset, *_ = experiment.controller.feedback("pen")
    np.testing.assert_allclose(np.diag(Kp), [64, 64, 64, 25, 25, 25])
    np.testing.assert_allclose(np.diag(Kv), [14.4] * 3 + [9.0] * 3)
    assert not offset.any()
    assert isinstance(experiment.controller.metric, metrics.MassMatrixMetric)
    (field,) = experiment.controller.field.terms
    assert field.weight == 2.0
    assert isinstance(field, JointCentering)
    assert isinstance(experiment.integrator, integrators.Rk4)
    positions = experiment.robot.joint_positions(experiment.q0)
    assert positions[3] == -2.0  # given by name
    assert positions[1] == experiment.robot.joint_positions(experiment.robot.home())[1]
    # The blend begins at the robot's pose, so the run starts without error.
    assert len(experiment.run()) == 3
    np.testing.assert_allclose(experiment.run()["task.pen.error"][0], 0.0, atol=1e-12)


@pytest.mark.parametrize("word", ["none", None])
def test_limits_are_the_robot_s_own_unless_there_are_to_be_none(
    word: str | None, tmp_path: Path
) -> None:
    own = load_experiment(PANDA)
    numbers = own.controller.limits
    assert numbers is not None
    np.testing.assert_array_equal(numbers.effort, own.robot.model.effortLimit)
    np.testing.assert_array_equal(numbers.velocity, own.robot.model.velocityLimit)
    np.testing.assert_array_equal(numbers.lower, own.robot.position_limits()[0])
    assert "limits" not in yaml.safe_load(own.to_yaml())

    free = load_experiment(changed("limits", word))
    assert free.controller.limits is None
    mine = tmp_path / "mine.yaml"
    mine.write_text(free.to_yaml())
    for again in (mine, free.run().save(tmp_path / "a.npz")):
        assert load_experiment(again).controller.limits is None


def test_limits_that_are_all_commented_out_are_not_none(tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    lines = yaml.safe_dump(PANDA).splitlines()
    file.write_text("\n".join([*lines, "limits:", "#  effort: 9"]))
    with pytest.raises(errors.ConfigError) as raised:
        load_experiment(file)
    reported = f"{file}:{len(lines) + 1}: limits: nothing ... none ... robot's own"
    assert re.search(wording(reported), str(raised.value))


def test_a_run_is_repeated_from_its_own_log(tmp_path: Path) -> None:
    first = load_experiment(MOVING, "simulation.duration=0.2").run()
    log = first.save(tmp_path / "run.npz")
    again = load_experiment(log).run()
    np.testing.assert_array_equal(first.tau, again.tau)
    assert Rollout.load(log).config == again.config


def test_a_log_of_a_robot_file_can_be_repeated_from_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from hsp_control.common.resources import bundled_robots

    urdf = (bundled_robots()["planar3r"] / "planar3r.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(urdf)
    data = {
        "robot": {"name": "arm.urdf"},
        "start": {"joints": [0.3, 0.8, 0.8]},
        "tasks": {"tip": {"type": "frame_position", "frame": "tip", "axes": "xy",
                          "trajectory": {"type": "hold"}}},
        "simulation": {"duration": 0.02},
    }  # fmt: skip
    (tmp_path / "arm.yaml").write_text(yaml.safe_dump(data))
    log = load_experiment(tmp_path / "arm.yaml").run().save(tmp_path / "arm.npz")
    monkeypatch.chdir("/")
    assert load_experiment(log).robot.nv == 3


# Each row: the changed value, the class of the error, and its message.
MISTAKES = [
    ("robot.name", "pandda", "RobotNotFoundError",
     "robot.name: no ... 'pandda' ... 'panda'"),
    ("robot.name", "missing/arm.urdf", "RobotNotFoundError",
     "robot.name: missing/arm.urdf: no such file"),
    ("robot.locked", {"panda_join1": 0.0}, "JointNotFoundError",
     "'panda_joint1'"),
    ("robot.tool_frames.pen.parent", "panda_hnd", "FrameNotFoundError",
     "no ... 'panda_hnd' ... 'panda_hand'"),
    ("start.joints", {"joint9": 1.0}, "JointNotFoundError",
     "start.joints.joint9: no joint 'joint9'"),
    ("start.configuration", [0.0] * 7, "ConfigurationError",
     "start is given twice"),
    ("start.velocity", [0.0] * 3, "ShapeError", "start.velocity: v0 ... (3,)"),
    ("start", {"coordinates": [0.0] * 7}, "ConfigurationError",
     "start.coordinates: panda ... joints"),
    ("tasks", None, "ConfigError", "tasks:"),
    ("tasks.pen.frame", "pan", "FrameNotFoundError",
     "tasks.pen.frame: no ... 'pan' ... 'pen'"),
    ("tasks.pen.wieght", 1, "ConfigError", "unknown ... 'wieght'"),
    ("tasks.pen.gains", {"kp": 1}, "GainError",
     "tasks.pen.gains: ... natural_frequency ... missing"),
    ("tasks.pen.gains", {"kp": [1, 2], "kv": 1}, "GainError",
     "tasks.pen.gains: kp ... (2,) ... a number"),
    ("tasks.pen.trajectory.position.center", [0, 0], "TrajectoryError",
     "tasks.pen.trajectory.position: ... dimension 2 ... 3"),
    ("tasks.more", {"type": "joint_posture"}, "ControllerError",
     "tasks: ... 13 rows (pen: 6, more: 7)"),
    ("null_space.gain", [1, 2], "GainError", "null_space.gain: ... (2,)"),
    ("null_space.metric", {"type": "coordinates"}, "MetricError",
     "null_space.metric: panda ... matrix"),
    ("null_space.metric", {"type": "constant", "matrix": [1, 1]}, "MetricError",
     "null_space.metric.matrix: the metric ... (2, 2) ... (7, 7)"),
    ("null_space.fields.0", {"type": "point_distance", "frames": ["pen"],
                             "obstacle": "ball"}, "SceneError",
     "null_space.fields.0.obstacle: no ... 'ball'"),
    ("null_space.fields.0", {"type": "equal_joint_angles", "joints": ["a", "b"]},
     "JointNotFoundError", "null_space.fields.0.joints.0: no joint 'a'"),
    ("null_space.fields.0", {"type": "target_posture", "target": [1.0]},
     "ShapeError",
     "null_space.fields.0.target: a posture ... (1,) ... 7 numbers"),
    ("null_space.fields", [{"type": "rest"}, {"type": "uncontrolled"}],
     "FieldError", "null_space.fields.1: 'uncontrolled' ... combined"),
    ("scene", {"obstacles": {"b": {"shape": {"type": "mesh", "file": "b.stl"},
                                   "center": {"type": "hold", "point": [0, 0, 0]}}}},
     "SceneError", "scene.obstacles.b.shape: mesh: no such file"),
    ("simulation.integrator.step", 0.0007, "SimulationError",
     "simulation.integrator.step: 0.0007 s ... control_period = 0.001 s"),
]  # fmt: skip


@pytest.mark.parametrize(
    ("path", "value", "error", "message"), MISTAKES, ids=lambda x: str(x)[:40]
)
def test_every_mistake_is_named(
    path: str, value: object, error: str, message: str, tmp_path: Path
) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(changed(path, value), sort_keys=False))
    with pytest.raises(getattr(errors, error)) as caught:
        load_experiment(file)
    assert re.search(wording(f"... {message}"), str(caught.value))
    assert check_place(caught.value, file)


def test_a_log_made_from_python_holds_no_configuration(tmp_path: Path) -> None:
    rollout = load_experiment(MOVING, "simulation.duration=0.01").run()
    del rollout.meta["config"]
    with pytest.raises(errors.ConfigError, match="made from Python"):
        load_experiment(rollout.save(tmp_path / "run.npz"))
