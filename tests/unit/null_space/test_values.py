"""All fields and metrics are values; the classes are found by reflection.

A value has no robot and no memory, so that one field serves many states, robots and
threads.
"""

import copy
import pickle
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from clearance_cases import AIR
from field_cases import evaluate
from loaded_robots import load
from values import assert_documented, assert_is_a_value

from hsp_control import NullSpaceField, Obstacle, RobotState, geometry
from hsp_control import trajectories as paths
from hsp_control.common.arrays import Array
from hsp_control.declaration import Part
from hsp_control.geometry import Scene, shapes
from hsp_control.geometry.scene import Start
from hsp_control.law import VARYING
from hsp_control.null_space import fields as null_space_fields
from hsp_control.null_space import metrics
from hsp_control.null_space.fields import Ramp
from hsp_control.null_space.metrics import MassMatrixMetric, Metric, MetricSample

BALL = Obstacle("ball", shapes.Sphere(0.1), AIR)
BOX = Obstacle("box", shapes.Box((0.2, 0.3, 0.1)), paths.Hold([0.6, 0.4, 0.2]))
COMMON = {
    "weight": Ramp(initial=0.5, final=2.0, start=0.3, duration=1.0),
    "name": "mine",
}
JACOBIAN = {"frame": "panda_hand", "axes": "xz"}
W = np.diag(np.linspace(0.5, 2.0, 7)) + 0.1
EXAMPLES: dict[str, list[dict[str, Any]]] = {
    "rest": [COMMON],
    "uncontrolled": [{"name": "mine"}],
    "joint_centering": [COMMON | {"weights": np.linspace(0.0, 2.0, 7)}],
    "limit_barrier": [COMMON | {"zone": 1.0, "weights": [1, 2, 3, 4, 5, 6, 7]}],
    "target_posture": [COMMON | {"target": np.linspace(-0.5, 0.5, 7), "weights": 2},
     {"target": "home"}, {"target": np.linspace(-0.4, 0.5, 7)},
     {"displacement": paths.Hold(np.full(7, 0.1))}],
    "equal_joint_angles": [COMMON | {"joints": ["panda_joint1", "panda_joint3"]}],
    "point_distance": [COMMON | {"frames": ("panda_hand",), "obstacle": BALL},
     {"frames": ["panda_hand", "panda_link4"], "obstacle": "ball"}],
    "manipulability": [
     COMMON | JACOBIAN | {"form": "log", "rows": "pose", "length": 0.3, "metric": W}],
    "inverse_condition": [COMMON | JACOBIAN | {"rows": "pose", "length": 0.3}],
    "obstacle_clearance": [COMMON | {"obstacles": [BALL, BOX], "influence": 0.5,
        "links": ["panda_link5", "panda_hand"], "proxy": "hulls"},
     {"obstacles": ("ball",)}],
    "self_clearance": [COMMON | {"influence": 0.3, "proxy": "spheres"}],
    "identity": [{}],
    "constant": [{"matrix": np.linspace(0.5, 2.0, 7)}, {"matrix": W}],
    "coordinates": [{"matrix": np.tril(np.ones((7, 7)))}],
    "mass_matrix": [{"inertia": 0.3}],
}  # fmt: skip
OTHER: dict[str, Any] = {
    "joints": ["panda_joint1", "panda_joint2"],
    "frames": ["panda_link4"],
    "obstacle": "box",
    "direction": [1, 2],
    "matrix": np.diag(np.linspace(1.0, 2.0, 7)),
}
"""Second values of fields without a default."""


def members() -> dict[str, type[Part]]:
    """Return the package's own members of both families."""
    assert NullSpaceField.family is not None
    assert Metric.family is not None
    found = NullSpaceField.family.members | Metric.family.members
    return {
        name: member
        for name, member in found.items()
        if member.__module__.startswith("hsp_control.")
    }


def examples(name: str) -> list[Part]:
    """Return the examples of a type."""
    return [members()[name](**arguments) for arguments in EXAMPLES[name]]


every_member = pytest.mark.parametrize("name", EXAMPLES)
MODULES = (null_space_fields, metrics, geometry, shapes, paths)
NAMES = {key: value for module in MODULES for key, value in vars(module).items()}


@every_member
def test_members_are_values(name: str) -> None:
    """The `repr` is the call that makes an equal value; every field has an effect."""
    member = members()[name]
    assert_documented(member)
    for arguments in EXAMPLES[name]:
        value = member(**arguments)
        assert_is_a_value(value, NAMES)
        assert value == member(**copy.deepcopy(arguments))
        for key in arguments:
            if key in OTHER:
                changed = replace(value, **{key: OTHER[key]})  # type: ignore[type-var]
            elif key == "target":
                changed = member(**arguments | {key: "start"})
            else:
                rest = {k: v for k, v in arguments.items() if k != key}
                changed = member(**rest)
            assert changed != value, key
    assert len({repr(value) for value in examples(name)}) == len(EXAMPLES[name])


@every_member
def test_placing_needs_a_robot_and_nothing_else(name: str) -> None:
    """Placing a placed value gives an equal one; placing and use leave no trace.

    The attributes of a part are its declared fields, before and after.
    """
    robot = load("panda")
    state = robot.state(0.0, robot.home(), np.linspace(-1.0, 1.0, 7))
    start = Start(state, Scene([BALL, BOX]))
    for value in (*examples(name), *defaults(name)):
        assert isinstance(value, NullSpaceField | Metric)
        if isinstance(value, metrics.CoordinatesMetric) and value.matrix is None:
            continue  # the panda defines none
        before = dict(vars(value))
        found = value.placed(start)
        assert type(found) is type(value)
        assert found.placed(start) == found
        used(found, state)
        if isinstance(found, NullSpaceField):
            declared = {field.name for field in fields(found)}
            assert set(vars(found)) == declared
            assert dict(vars(value)).keys() == before.keys()
        pickle.dumps(found)


def defaults(name: str) -> list[Part]:
    """Return the value without arguments, if there is one."""
    needed = set(OTHER) - {"matrix"} | ({"matrix"} if name == "constant" else set())
    free = all(key not in needed for case in EXAMPLES[name] for key in case)
    return [members()[name]()] if free else []


def used(part: NullSpaceField | Metric, state: RobotState) -> list[Array]:
    """Return a part's results at a state: directly, and by its calls."""
    nv = state.robot.nv
    if isinstance(part, Metric):
        direct, planned = MetricSample.allocate(nv), MetricSample.allocate(nv)
        part.evaluate(state, direct)
        state.run(part.calls(state, planned))
        return [np.array(each) for each in (*direct, *planned)]
    found = [np.array(part.value(state)), *evaluate(part, MassMatrixMetric(), state)]
    metric = MassMatrixMetric().evaluate(state, MetricSample.allocate(nv))
    out = null_space_fields.FieldSample.allocate(nv)
    state.run(part.calls(state, metric, VARYING, out))
    least = part.minimum_distance(state)
    return [*found, *out, np.array(0.0 if least is None else least)]


# --- threads -------------------------------------------------------------------------
