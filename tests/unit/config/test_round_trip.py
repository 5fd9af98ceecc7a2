"""A configuration as plain data, as logs store it, has the same meaning."""

import json
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from exported_schema import validator
from places import covering
from wording import wording

from hsp_control import (
    Controller,
    Experiment,
    FramePose,
    FunctionCost,
    Gains,
    JointCentering,
    JointPosture,
    Limits,
    ObstacleClearance,
    Sphere,
    load_experiment,
)
from hsp_control.common.errors import ConfigError, HspControlError, SceneError
from hsp_control.common.resources import bundled_configs
from hsp_control.config.document import Document
from hsp_control.config.loaded_scenario import validate
from hsp_control.config.scenario import NullSpaceSettings, Scenario
from hsp_control.constraints.limits import ObstacleDistance, Scaled
from hsp_control.control.changes import ChangeGains
from hsp_control.declaration.plain_data import plain_data
from hsp_control.geometry import Obstacle
from hsp_control.geometry.scene import Scene
from hsp_control.null_space.metrics import MassMatrixMetric
from hsp_control.tasks import FramePosition
from hsp_control.trajectories import Hold

EVERYTHING: dict[str, Any] = {
    "robot": {"name": "panda", "tool_frames": {"pen": {"parent": "panda_hand"}}},
    "start": {"joints": {"panda_joint4": -2.0}},
    "scene": {"obstacles": {"ball": {"shape": {"type": "sphere", "radius": 0.1},
           "center": {"type": "hold", "point": [1, 1, 1]},
           "orientation": {"type": "spin", "axis": [0, 0, 1], "rate": 1}}}},
    "tasks": {"hand": {"type": "frame_pose",
        "trajectory": {"type": "composed", "position": {"type": "hold"}},
        "gains": {"kp": [1, 1, 1, 2, 2, 2], "kv": 2},
        "schedule": {"intervals": [[0, None]], "ramp": 0.1}},
     "posture": {"type": "joint_posture", "reference": "home", "priority": 2}},
    "limits": {"effort": {"scale": {"panda_joint1": 0.5}}, "velocity": "none",
     "acceleration": [None, 1, 1, 1, 1, 1, 1],
     "position": {"lower": -3, "upper": [3, 3, 3, None, 3, 3, 3]},
     "barriers": [{"type": "obstacle_distance", "obstacles": ["ball"]},
                  {"type": "self_distance"}]},
    "null_space": {"gain": [[2, 1], [0, 2]],
     "metric": {"type": "constant", "matrix": [1, 2]}, "fields": [
        {"type": "joint_centering", "weight": {"final": 1, "duration": 2}},
        {"type": "target_posture", "target": "start"}]},
    "changes": [{"type": "add_task", "at": 1,
        "task": {"type": "pointing", "name": "eye", "direction": [0, 0, 1]}},
     {"type": "gains", "at": 2, "task": "hand", "gains": {"kp": 1, "kv": 1}},
     {"type": "field", "at": 3, "fields": [{"type": "manipulability"}]},
     {"type": "weight", "at": 4, "field": "manipulability", "weight": 2},
     {"type": "null_space_gain", "at": 5, "gain": 3},
     {"type": "remove_task", "at": 6, "task": "hand"},
     {"type": "contact", "at": 7, "contact": "sole", "active": False}],
    "plant": {"type": "rigid_contacts", "contacts": {
        "panda_hand": {"kind": "point", "on": [[1, 2]]}}},
    "compensation": {"predictor": {}, "momentum_observer": {"clip": [1, None]},
     "friction_feed_forward": "urdf",
     "integral_action": {"ki": {"hand": [[9, 0], [0, 9]]}, "tasks": ["hand"]}},
    "simulation": {"control_period": 0.001},
}  # fmt: skip


NAMES = [*bundled_configs(), "everything"]


@cache
def scenario_of(name: str) -> Scenario:
    """Return a bundled configuration, or the one with a little of everything."""
    bundled = bundled_configs()
    if name in bundled:
        return validate(Document.read(bundled[name]), Scenario)
    return validate(Document(EVERYTHING, {}, name), Scenario)


@pytest.mark.parametrize(("name", "defaults"), covering(NAMES, [False, True]))
def test_a_configuration_equals_its_plain_data(name: str, defaults: bool) -> None:
    scenario = scenario_of(name)
    data = plain_data(scenario, defaults=defaults)
    assert validate(Document(data, {}, name), Scenario) == scenario
    # Neither does a way through JSON or YAML change it.
    assert json.loads(json.dumps(data, allow_nan=False)) == data
    again = Document.parse(yaml.safe_dump(data), name)
    assert validate(again, Scenario) == scenario
    assert not list(validator().iter_errors(data))


def test_with_defaults_no_key_is_missing() -> None:
    data = plain_data(scenario_of("everything"), defaults=True)
    assert set(data) == {field.name for field in fields(Scenario)}
    assert data["scene"]["obstacles"]["ball"]["center"]["origin"] == "world"
    assert data["tasks"]["hand"]["blend"] is None
    least = Document(
        {"robot": {"name": "panda"}, "tasks": EVERYTHING["tasks"]}, {}, "least"
    )
    empty = validate(least, Scenario)
    assert plain_data(empty, defaults=True)["scene"] == {"obstacles": {}}
    assert plain_data(empty, defaults=True)["contacts"] == {}


def test_options_of_python_alone_are_named() -> None:
    cost = FunctionCost(lambda q, t: 0.0)
    model = NullSpaceSettings(fields=[cost])
    with pytest.raises(ConfigError, match=r"^fields\.0.function: YAML cannot express"):
        plain_data(model)


# -- experiments ----------------------------------------------------------------------


def parts(**settings: Any) -> Experiment:
    """Return an experiment made of parts."""
    here = [0.4, 0.0, 0.5]
    return Experiment(
        "panda",
        [
            FramePosition(trajectory=Hold(here), gains=Gains(9, 6), name="hand"),
            JointPosture(priority=2, reference="home"),
        ],
        2.0 * JointCentering() + ObstacleClearance(["ball"]),
        null_space_gain=[5.0] * 7,
        metric=MassMatrixMetric(),
        limits=Limits(velocity=Scaled(0.5)),
        scene=[Obstacle("ball", Sphere(0.1), Hold([0.9, 0.0, 0.9]))],
        changes=[ChangeGains("hand", Gains(16, 8), at=0.01)],
        **{"simulation": {"duration": 0.03}, **settings},
    )


def test_an_experiment_of_parts_goes_to_yaml_and_back(tmp_path: Path) -> None:
    made = parts()
    file = tmp_path / "mine.yaml"
    file.write_text(made.to_yaml(), encoding="utf-8")
    again = load_experiment(file)
    assert again.scenario == made.scenario
    first, second = made.run(), again.run()
    np.testing.assert_array_equal(first.tau, second.tau)
    assert not list(validator().iter_errors(yaml.safe_load(made.to_yaml())))
    # A log stores the same, and its run can be repeated.
    log = load_experiment(first.save(tmp_path / "run.npz"))
    np.testing.assert_array_equal(log.run().tau, first.tau)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"simulation": {"duraton": 1}},
         "experiment: simulation.duraton: unknown ... 'duraton'"),
        ({"plant": "rigidbody"}, "experiment: plant.type: unknown ... 'rigidbody'"),
        ({"name": "mine", "start": {"joints": [1]}}, "mine: start.joints: ... (1,)"),
    ],
)  # fmt: skip
def test_a_wrong_setting_is_named(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(HspControlError, match=wording(message)):
        parts(**settings)


def test_obstacles_that_parts_hold_are_in_the_scene() -> None:
    """YAML names obstacles; a part that holds one in Python is written with its
    name."""
    ball = Obstacle("ball", Sphere(0.1), Hold([0.6, 0.4, 0.6]))
    field = JointCentering() + 20.0 * ObstacleClearance([ball])
    limits = Limits(barriers=[ObstacleDistance(obstacles=[ball])])
    experiment = Experiment("panda", [FramePose("panda_tcp")], field, limits=limits)
    assert experiment.scenario.scene == Scene([ball])
    again = load_experiment(yaml.safe_load(experiment.to_yaml()))
    assert again.scenario == experiment.scenario
    q, v = experiment.q0 + 0.1, np.full(7, 0.1)
    controller = Controller(
        experiment.robot, experiment.controller.tasks, field, limits=limits,
        start=experiment.q0,
    )  # fmt: skip
    tau = experiment.controller.compute(0.0, q, v).tau
    np.testing.assert_array_equal(tau, again.controller.compute(0.0, q, v).tau)
    np.testing.assert_array_equal(tau, controller.compute(0.0, q, v).tau)
    other = Obstacle("ball", Sphere(0.2), Hold([0.6, 0.4, 0.6]))
    with pytest.raises(SceneError, match="two obstacles have the name 'ball'"):
        Experiment("panda", [FramePose("panda_tcp")], field, scene=[other])
