"""Trajectories are values: equal, immutable, checked, placed at a robot's start."""

import dataclasses
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from trajectory_cases import (
    CIRCLE,
    IDENTITY,
    LISSAJOUS,
    MEMBERS,
    POINTS,
    R1,
    R2,
    SPIN,
    TIMES,
    flat,
    nodding,
    pose,
    swinging,
)
from values import assert_is_a_value

import hsp_control.trajectories as family
from hsp_control.common.errors import TrajectoryError
from hsp_control.engine.plans import planned
from hsp_control.trajectories import (
    Along,
    AlongOrientation,
    AlongPose,
    Blend,
    BlendOrientation,
    CallableOrientation,
    CallableTrajectory,
    Circle,
    ComposedPose,
    Crossfade,
    CrossfadeOrientation,
    Hold,
    HoldOrientation,
    HoldPose,
    Line,
    Lissajous,
    MinimumJerk,
    OrientationPath,
    OrientationSample,
    PiecewisePolynomial,
    Polyline,
    PolylinePose,
    PoseSample,
    Schedule,
    ScrewInterpolation,
    Spin,
    Spline,
    Stops,
    TrajectorySample,
    UniformLine,
)

SCHEDULE = Schedule([(-np.inf, 1.0), (2.0, 4.0)], ramp=0.5)
VALUES: dict[str, Any] = {
    **{name: member for name, (member, _) in MEMBERS.items()},
    "schedule": SCHEDULE,
    "schedule without end": Schedule.always(),
    "circle from the start": Circle(0.1, 2.0, origin="start", center=[0.1, 0, 0]),
    "nested": ComposedPose(Blend(Circle(0.1, 2.0), 1.0), BlendOrientation(SPIN, 2)),
}
every_value = pytest.mark.parametrize("name", VALUES)


# --- one value, constructed in different ways -----------------------------------------


@every_value
def test_trajectories_are_values(name: str) -> None:
    """A pickled one moves identically: caches are not part of the value."""
    value = VALUES[name]
    if name in MEMBERS:
        before, again = value.sample(0.7), pickle.loads(pickle.dumps(value))
        for a, b in zip(flat(before), flat(again.sample(0.7)), strict=True):
            np.testing.assert_array_equal(a, b)
    assert_is_a_value(value, vars(family))
    assert all(value != other for key, other in VALUES.items() if key != name)


# --- wrong arguments ------------------------------------------------------------------

NUMBER = ["fast", np.nan, -np.inf, None, True, [1.0], {}, 1j]
POSITIVE = [*NUMBER, 0, -1.0, 0.0, np.float32(-2)]
POSITIVE_OR_NONE = [value for value in POSITIVE if value is not None]
OPTIONAL_VECTOR = [
    1.0, [], "here", ["here"], [np.nan, 0, 0], [0, 0, np.inf], [[1.0, 2.0, 3.0]],
    [True, False, True], [None, 1, 2], {"x": 1}, [1j, 0, 0], b"123", np.zeros((0, 3)),
]  # fmt: skip
VECTOR = [*OPTIONAL_VECTOR, None]
OPTIONAL_VECTOR3 = [*OPTIONAL_VECTOR, [1.0], [1.0, 2.0], [1.0, 2.0, 3.0, 4.0]]
VECTOR3 = [*OPTIONAL_VECTOR3, None]
OPTIONAL_MATRIX = [1.0, [], [[]], "rows", [1.0, 2.0], [[1], [2, 3]], [[np.nan, 1]]]
MATRIX = [*OPTIONAL_MATRIX, None]
OPTIONAL_ROTATION = [
    "up", 1.0, [1.0], [0.0, 0.0], 2.0 * IDENTITY, np.diag([1.0, 1.0, -1.0]),
    [1, 1, 1, 1], [[1, 0], [0, 1]], np.eye(4), [np.nan, 0, 0], [IDENTITY],
    [[1], [0, 1]], {"rpy": 0},
]  # fmt: skip
ROTATION = [*OPTIONAL_ROTATION, None]
CHILD = [None, 1.0, "circle", {}, {"type": "spyn"}, SCHEDULE, Circle]
FUNCTION = [None, 1.0, "f"]
# For each class: valid arguments, and per field all invalid ones.
WRONG: dict[type, tuple[dict[str, Any], dict[str, list[Any]]]] = {
    Hold: ({"point": [1, 2, 3]}, {"point": OPTIONAL_VECTOR}),
    Line: (
        {"end": [1, 2, 3], "duration": 1, "start": [0, 0, 0]},
        {"end": VECTOR, "duration": POSITIVE, "start": OPTIONAL_VECTOR,
         "start_time": NUMBER},
    ),
    UniformLine: (
        {"velocity": [1, 2, 3], "start": [0, 0, 0]},
        {"velocity": VECTOR, "start": OPTIONAL_VECTOR},
    ),
    Circle: (
        {"radius": 1, "angular_rate": 2, "center": [0, 0, 0]},
        {"radius": POSITIVE, "angular_rate": NUMBER, "center": OPTIONAL_VECTOR,
         "phase": NUMBER, "normal": [*OPTIONAL_VECTOR3, [0, 0, 0]],
         "toward": OPTIONAL_VECTOR3, "axes": OPTIONAL_MATRIX},
    ),
    Lissajous: (
        {"amplitudes": [1, 1, 1], "rates": [1, 2, 3], "center": [0, 0, 0]},
        {"amplitudes": VECTOR, "rates": VECTOR, "phases": OPTIONAL_VECTOR,
         "center": OPTIONAL_VECTOR},
    ),
    MinimumJerk: (
        {"waypoints": POINTS, "times": TIMES}, {"waypoints": MATRIX, "times": VECTOR}
    ),
    Stops: (
        {"waypoints": POINTS, "times": TIMES}, {"waypoints": MATRIX, "times": VECTOR}
    ),
    Spline: (
        {"waypoints": POINTS, "times": TIMES},
        {"waypoints": MATRIX, "times": VECTOR, "degree": [4, None, "5", [5], -3]},
    ),
    PiecewisePolynomial: (
        {"times": [0, 1], "coefficients": [[[1, 2, 3], [4, 5, 6]]]},
        {"times": VECTOR, "coefficients": [*MATRIX, [[1.0]], [[[1], [2, 3]]]],
         "end": OPTIONAL_VECTOR},
    ),
    CallableTrajectory: (
        {"function": swinging, "dimension": 3},
        {"function": FUNCTION, "dimension": [0, -1, 2.5, "3", None, True, [3]],
         "velocity": FUNCTION[1:], "acceleration": FUNCTION[1:], "step": POSITIVE},
    ),
    Blend: (
        {"trajectory": LISSAJOUS, "duration": 1, "start": [0, 0, 0]},
        {"trajectory": [*CHILD, SPIN], "duration": POSITIVE, "start": OPTIONAL_VECTOR,
         "start_velocity": OPTIONAL_VECTOR, "start_time": NUMBER},
    ),
    HoldOrientation: ({}, {"rotation": OPTIONAL_ROTATION}),
    Spin: (
        {"axis": [1, 0, 0], "rate": 1},
        {"axis": [*VECTOR3, [0, 0, 0]], "rate": NUMBER, "rotation": OPTIONAL_ROTATION},
    ),
    OrientationPath: (
        {"rotations": [R1, R2], "times": [0, 1]},
        {"rotations": [1.0, "up", [1.0], IDENTITY[0], None, [IDENTITY, [0, 0, 0]],
                       [[1, 2], [3, 4]], [IDENTITY, 2 * IDENTITY],
                       [[0, 0, np.nan]] * 2],
         "times": VECTOR},
    ),
    CallableOrientation: (
        {"function": nodding}, {"function": FUNCTION, "step": POSITIVE}
    ),
    BlendOrientation: (
        {"trajectory": SPIN, "duration": 1},
        {"trajectory": [*CHILD, CIRCLE], "duration": POSITIVE,
         "rotation": OPTIONAL_ROTATION, "start_angular_velocity": VECTOR3,
         "start_angular_acceleration": VECTOR3, "start_time": NUMBER},
    ),
    Crossfade: (
        {"before": CIRCLE, "after": CIRCLE},
        {"before": [*CHILD, SPIN], "after": [*CHILD, SPIN], "start_time": NUMBER,
         "duration": [-1.0, "up", np.nan, None]},
    ),
    CrossfadeOrientation: (
        {"before": SPIN, "after": SPIN},
        {"before": [*CHILD, CIRCLE], "after": [*CHILD, CIRCLE], "start_time": NUMBER,
         "duration": [-1.0, "up", np.nan, None]},
    ),
    Along: (
        {"path": CIRCLE, "speed": 1},
        {"path": [*CHILD, SPIN], "speed": POSITIVE,
         "acceleration": POSITIVE_OR_NONE, "start_time": NUMBER,
         "interval": [*OPTIONAL_VECTOR, [1], [1, 0], [1, 1, 1]]},
    ),
    AlongOrientation: (
        {"path": SPIN, "speed": 1},
        {"path": [*CHILD, CIRCLE], "speed": POSITIVE, "acceleration": POSITIVE_OR_NONE,
         "start_time": NUMBER, "interval": [*OPTIONAL_VECTOR, [1], [1, 0]]},
    ),
    AlongPose: (
        {"path": ComposedPose(LISSAJOUS, SPIN), "speed": 1},
        {"path": [*CHILD, CIRCLE, SPIN], "speed": POSITIVE,
         "acceleration": POSITIVE_OR_NONE, "start_time": NUMBER,
         "interval": [*OPTIONAL_VECTOR, [1], [1, 0]]},
    ),
    Polyline: (
        {"waypoints": POINTS[:2], "speed": 1, "acceleration": 1},
        {"waypoints": MATRIX, "speed": POSITIVE, "acceleration": POSITIVE,
         "blend_radius": [-1.0, "wide", np.nan, None], "start_time": NUMBER},
    ),
    PolylinePose: (
        {"waypoints": POINTS[:2], "speed": 1, "acceleration": 1,
         "rotations": [R1, R2]},
        {"waypoints": [*MATRIX, [[0, 0], [1, 1]]], "speed": POSITIVE,
         "acceleration": POSITIVE, "blend_radius": [-1.0, "wide", np.nan, None],
         "rotations": [1.0, "up", [R1, 2 * R1], [[0, 0]]], "start_time": NUMBER},
    ),
    HoldPose: ({}, {"position": OPTIONAL_VECTOR3, "rotation": OPTIONAL_ROTATION}),
    ComposedPose: (
        {}, {"position": [*CHILD, SPIN, CIRCLE], "orientation": [*CHILD, CIRCLE]}
    ),
    ScrewInterpolation: (
        {"position": [1, 2, 3], "rotation": R1, "duration": 1},
        {"position": VECTOR3, "rotation": ROTATION, "duration": POSITIVE,
         "start_time": NUMBER, "start_position": OPTIONAL_VECTOR3,
         "start_rotation": OPTIONAL_ROTATION},
    ),
}  # fmt: skip
ONE_BY_ONE = [(kind, field) for kind, (_, wrong) in WRONG.items() for field in wrong]


@pytest.mark.parametrize(
    ("kind", "field"), ONE_BY_ONE, ids=[f"{k.__name__}.{f}" for k, f in ONE_BY_ONE]
)
def test_a_wrong_value_is_one_error_with_class_and_field(
    kind: type, field: str
) -> None:
    right, wrong = WRONG[kind]
    kind(**right)
    for value in wrong[field]:
        with pytest.raises(TrajectoryError) as caught:
            kind(**{**right, field: value})
        message = str(caught.value)
        assert type(caught.value) is TrajectoryError
        assert message.startswith(f"{kind.__name__}: {field}"), message
        assert "\n" not in message
        assert "validat" not in message, message  # no words of pydantic
        assert "function-" not in message, message
        assert caught.value.__suppress_context__


# --- where the robot starts -----------------------------------------------------------

START = np.array([0.3, -0.2, 0.5])
PLACED = [kind for kind in WRONG if getattr(kind, "points", ())]
every_placed = pytest.mark.parametrize("kind", PLACED, ids=lambda kind: kind.__name__)


def assert_relative(trajectory: Any, sample: Any) -> None:
    assert trajectory.relative
    for use in (trajectory.sample, lambda t: trajectory.sample(t, sample)):
        with pytest.raises(TrajectoryError, match="the robot starts, which only a"):
            use(0.0)
    with pytest.raises(TrajectoryError, match="the robot starts, which only a"):
        planned(trajectory.calls(sample)).run(0.0)


@every_placed
def test_an_omitted_point_is_where_the_robot_starts(kind: Any) -> None:
    given = WRONG[kind][0]
    optional = [
        field.name
        for field in dataclasses.fields(kind)
        if field.name in kind.points and field.default is None
    ]
    for name in optional:
        trajectory = kind(**{key: each for key, each in given.items() if key != name})
        assert_relative(trajectory, TrajectorySample.allocate(3))
        anchored = trajectory.anchored(START)
        assert anchored == kind(**{**given, name: START})
        assert not anchored.relative
        with pytest.raises(TrajectoryError, match=f"{name} is missing: nothing starts"):
            trajectory.anchored(None)


def test_a_blend_begins_and_ends_about_the_start() -> None:
    blend = Blend(Circle(0.1, 2.0), 1.5)
    assert_relative(blend, TrajectorySample.allocate(3))
    anchored = blend.anchored(START)
    assert anchored == Blend(Circle(0.1, 2.0, START), 1.5, start=START)
    np.testing.assert_array_equal(anchored.sample(0.0).position, START)
    fixed = Blend(Circle(0.1, 2.0), 1.5, start=[0, 0, 0])
    assert fixed.relative
    assert fixed.anchored(START) == Blend(Circle(0.1, 2, START), 1.5, start=[0, 0, 0])
    with pytest.raises(TrajectoryError, match="nothing starts here"):
        fixed.anchored(None)


@pytest.mark.parametrize("trajectory", [
    CallableTrajectory(swinging, 3, origin="start"),
    PiecewisePolynomial([0, 1], [[[1, 2, 3]]], origin="start"),
])  # fmt: skip
def test_trajectories_without_points_cannot_be_relative_to_the_start(
    trajectory: Any,
) -> None:
    assert_relative(trajectory, TrajectorySample.allocate(3))
    with pytest.raises(TrajectoryError, match="origin: start cannot move a"):
        trajectory.anchored(START)


def test_a_circle_is_level_about_the_start() -> None:
    circle = Circle(0.1, 2.0).anchored(START)
    assert circle.center is not None
    np.testing.assert_array_equal(circle.center, START)
    for t in (0.0, 0.3, 2.0):
        x, x_dot, _ = circle.sample(t)
        assert x[2] == START[2]
        assert x_dot[2] == 0.0
        arm = x - START
        assert np.linalg.norm(arm) == pytest.approx(0.1)
        np.testing.assert_allclose(x_dot, np.cross([0, 0, 2.0], arm), atol=1e-15)
    np.testing.assert_allclose(circle.sample(0.0).position, [0.4, -0.2, 0.5])
    flat_circle = Circle(0.1, 2.0).anchored([1.0, 2.0])
    np.testing.assert_allclose(flat_circle.sample(0.0).position, [1.1, 2.0])
    with pytest.raises(
        TrajectoryError, match=r"^Circle: a circle in dimension 4 needs"
    ):
        Circle(0.1, 2.0).anchored([0, 0, 0, 0])


@pytest.mark.parametrize(
    "trajectory",
    [HoldOrientation(), Spin([0, 1, 0], 2.0), BlendOrientation(SPIN, 1.5)],
    ids=lambda each: type(each).__name__,
)
def test_an_omitted_rotation_is_that_of_the_start(trajectory: Any) -> None:
    assert_relative(trajectory, OrientationSample.allocate())
    anchored = trajectory.anchored(R2)
    assert anchored == dataclasses.replace(trajectory, rotation=R2)
    np.testing.assert_allclose(anchored.sample(0.0).rotation, R2, atol=1e-14)
    assert anchored.anchored(R1) == anchored
    angles = [0.1, 0.2, 0.3]
    np.testing.assert_allclose(
        trajectory.anchored(angles).sample(0.0).rotation,
        pin.rpy.rpyToMatrix(*angles),
        atol=1e-15,
    )


POSES: dict[str, tuple[Any, Callable[[pin.SE3], Any]]] = {
    "hold": (HoldPose(), lambda M: HoldPose(M.translation, M.rotation)),
    "hold a rotation": (HoldPose(rotation=R1), lambda M: HoldPose(M.translation, R1)),
    "composed": (ComposedPose(),
     lambda M: ComposedPose(Hold(M.translation), HoldOrientation(M.rotation))),
    "composed of one": (ComposedPose(LISSAJOUS),
     lambda M: ComposedPose(LISSAJOUS, HoldOrientation(M.rotation))),
    "screw": (ScrewInterpolation(POINTS[0], R1, 2.0, start_time=1.0),
     lambda M: ScrewInterpolation(POINTS[0], R1, 2.0, start_time=1.0,
        start_position=M.translation, start_rotation=M.rotation)),
    "screw from a place": (
     ScrewInterpolation(POINTS[0], R1, 2.0, start_position=POINTS[1]),
     lambda M: ScrewInterpolation(POINTS[0], R1, 2.0, start_position=POINTS[1],
        start_rotation=M.rotation)),
}  # fmt: skip


@pytest.mark.parametrize("name", POSES)
def test_poses_start_where_the_robot_starts(name: str) -> None:
    trajectory, expected = POSES[name]
    assert trajectory.relative
    with pytest.raises(TrajectoryError, match="the robot starts, which only a"):
        trajectory.sample(0.0)
    with pytest.raises(TrajectoryError, match="the robot starts, which only a"):
        planned(trajectory.calls(PoseSample.allocate())).run(0.0)
    start = pose(9)
    anchored = trajectory.anchored(start)
    assert anchored == expected(start)
    assert not anchored.relative
    assert anchored.anchored(pose(3)) == anchored
    anchored.sample(0.0)
