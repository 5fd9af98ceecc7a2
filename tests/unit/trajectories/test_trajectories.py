"""One set of tests for all trajectories: points, orientations and poses."""

import copy
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import THOROUGH
from trajectory_cases import (
    CIRCLE,
    IDENTITY,
    LISSAJOUS,
    MEMBERS,
    POINT_MEMBERS,
    POINTS,
    R1,
    R2,
    R3,
    SPIN,
    flat,
    screw,
    swinging,
)
from wording import wording

import hsp_control.trajectories as family
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ImmutableError, ShapeError, TrajectoryError
from hsp_control.declaration.quantities import Number
from hsp_control.engine.rotations import log3
from hsp_control.trajectories import (
    Blend,
    CallableOrientation,
    CallableTrajectory,
    Circle,
    ComposedPose,
    HoldOrientation,
    Line,
    Lissajous,
    MinimumJerk,
    OrientationPath,
    OrientationTrajectory,
    PiecewisePolynomial,
    PoseTrajectory,
    ScrewInterpolation,
    Spline,
    Trajectory,
    TrajectorySample,
    UniformLine,
)

# These do not start at rest, as documented: a jump of velocity or acceleration.
ROUGH = {
    "spline 3",
    "polynomial",
    "blend in motion",
    "blend orientation in motion",
    "along a parabola",
    "along a function",
    "along a composed pose",
}

every_member = pytest.mark.parametrize("name", MEMBERS)
SPARSE = 1 if THOROUGH else 8  # every n-th of the steps without a knot
quick = settings(max_examples=60, deadline=None, derandomize=True)


def parts(sample: Any) -> Iterator[tuple[Array, Array, Array]]:
    """Yield value, rate and acceleration: once, or twice for a pose."""
    arrays = flat(sample)
    for i in range(0, len(arrays), 3):
        yield arrays[i], arrays[i + 1], arrays[i + 2]


def displacement(a: Array, b: Array) -> Array:
    """Return b - a; for rotations the world's rotation vector from a to b."""
    if a.ndim == 1:
        return b - a
    return log3(b @ a.T)


def five_points(values: list[Array], h: float) -> Array:
    """Return the first derivative from values at -2h, -h, h and 2h."""
    before2, before1, after1, after2 = values
    return (before2 - 8 * before1 + 8 * after1 - after2) / (12 * h)


@every_member
def test_rates_are_those_of_the_motion(name: str) -> None:
    trajectory, knots = MEMBERS[name]
    h = 1e-3
    for t in np.random.default_rng(7).uniform(-0.3, 2.6, 40):
        if any(abs(t - knot) < 3 * h for knot in knots):
            continue
        here = trajectory.sample(t)
        around = [trajectory.sample(t + k * h) for k in (-2, -1, 1, 2)]
        for i, (place, rate, acceleration) in enumerate(parts(here)):
            near = [list(parts(s))[i] for s in around]
            moved = five_points([displacement(place, n[0]) for n in near], h)
            np.testing.assert_allclose(rate, moved, rtol=1e-8, atol=2e-8)
            sped = five_points([n[1] for n in near], h)
            np.testing.assert_allclose(acceleration, sped, rtol=1e-7, atol=2e-7)


@pytest.mark.slow
@every_member
def test_motion_never_jumps(name: str) -> None:
    """Small steps equal the integral of the rate; changes of rate that of x''."""
    trajectory, knots = MEMBERS[name]
    rough = {knots[0], knots[-1]} if name in ROUGH else set()
    for k, (one, other) in enumerate(pairwise(np.linspace(-0.3, 2.6, 500))):
        within = [knot for knot in knots if one <= knot <= other]
        if not rough.isdisjoint(within) or (k % SPARSE and not within):
            continue
        h = other - one
        before, after = trajectory.sample(one), trajectory.sample(other)
        for a, b in zip(parts(before), parts(after), strict=True):
            moved = displacement(a[0], b[0])
            np.testing.assert_allclose(moved, h * (a[1] + b[1]) / 2, rtol=0, atol=1e-4)
            sped = b[1] - a[1]
            np.testing.assert_allclose(sped, h * (a[2] + b[2]) / 2, rtol=0, atol=1e-2)


@every_member
def test_writing_into_out_equals_a_fresh_sample(name: str) -> None:
    trajectory, _ = MEMBERS[name]
    for t in (-0.5, 0.7, 1.0, 3):
        fresh = trajectory.sample(t)
        out = copy.deepcopy(fresh)
        for array in flat(out):
            array.fill(np.nan)
        assert trajectory.sample(t, out) is out
        for a, b in zip(flat(out), flat(fresh), strict=True):
            np.testing.assert_array_equal(a, b)
            assert np.isfinite(a).all()
            assert a.dtype == np.float64


@pytest.mark.parametrize("name", POINT_MEMBERS)
def test_dimension(name: str) -> None:
    trajectory, _ = POINT_MEMBERS[name]
    n = trajectory.dimension
    assert all(array.shape == (n,) for array in trajectory.sample(0.3))
    message = f"out has dimension {n + 1}; this .* has dimension {n}"
    with pytest.raises(ShapeError, match=message):
        trajectory.sample(0.3, TrajectorySample.allocate(n + 1))


@quick
@given(st.integers(0, 10**6), st.integers(2, 8))
def test_minimum_jerk_is_the_quintic_spline_at_rest(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(count, 2))
    times = np.cumsum(rng.uniform(0.2, 2.0, count))
    own, scipys = MinimumJerk(points, times), Spline(points, times)
    for t, point in zip(times, points, strict=True):
        np.testing.assert_allclose(own.sample(t).position, point, atol=1e-12)
    for t in rng.uniform(times[0], times[-1], 10):
        for a, b in zip(own.sample(t), scipys.sample(t), strict=True):
            np.testing.assert_allclose(a, b, rtol=1e-8, atol=1e-8)


@quick
@given(st.integers(0, 10**6))
def test_orientations_have_three_notations(seed: int) -> None:
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-1.5, 1.5, 3)
    R = pin.rpy.rpyToMatrix(*angles)
    for notation in (angles, pin.Quaternion(R).coeffs(), R):
        held = HoldOrientation(notation).sample(0.0).rotation
        np.testing.assert_allclose(held, R, rtol=0, atol=1e-15)


@pytest.mark.parametrize(("rate", "tolerance"), [(1.0, 1e-10), (10.0, 5e-9)])
def test_callable_is_as_accurate_as_documented(rate: float, tolerance: float) -> None:
    circle = Circle(1, rate, [1, 1])
    numerical = CallableTrajectory(lambda t: circle.sample(t).position, 2)
    for t in np.linspace(0, 3, 30):
        exact, found = circle.sample(t), numerical.sample(t)
        np.testing.assert_allclose(
            found.acceleration, exact.acceleration, rtol=0, atol=tolerance
        )


@quick
@given(st.integers(0, 10**6))
def test_blend_leads_from_the_start_into_the_trajectory(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, velocity = rng.normal(size=(2, 3))
    t0, duration = rng.normal(), rng.uniform(0.1, 4.0)
    blend = Blend(
        LISSAJOUS, duration, start=start, start_velocity=velocity, start_time=t0
    )
    x, x_dot, x_ddot = blend.sample(t0)
    np.testing.assert_array_equal(x, start)
    np.testing.assert_array_equal(x_dot, velocity)
    np.testing.assert_array_equal(x_ddot, np.zeros(3))
    for t in (t0 + 1.0001 * duration, t0 + 9.0):
        for a, b in zip(blend.sample(t), LISSAJOUS.sample(t), strict=True):
            np.testing.assert_array_equal(a, b)


@quick
@given(st.integers(0, 10**6))
def test_screw_is_pinocchios(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, end = (
        pin.SE3(pin.exp3(rng.uniform(-1.7, 1.7, 3)), rng.normal(size=3))
        for _ in range(2)
    )
    motion = screw(start, end, 2.0, -1.0)
    weight = Line([1.0], 2.0, start=[0.0], start_time=-1.0)
    for t in (-2.0, -1.0, -0.5, 0.0, 0.7, 1.0, 5.0):
        s = weight.sample(t).position[0]
        expected = start * pin.exp6(s * pin.log6(start.actInv(end)))
        position, orientation = motion.sample(t)
        np.testing.assert_allclose(position.position, expected.translation, atol=1e-11)
        np.testing.assert_allclose(orientation.rotation, expected.rotation, atol=1e-12)
    for t, held in ((-1.0, start), (1.0, end)):
        position, orientation = motion.sample(t)
        np.testing.assert_array_equal(position.position, held.translation)
        np.testing.assert_array_equal(orientation.rotation, held.rotation)


def test_orientation_path_uses_the_shortest_rotations() -> None:
    path = OrientationPath([R1, R2, R3], [0.0, 1.0, 3.0])
    for t, R in ((0.0, R1), (1.0, R2), (3.0, R3)):
        sample = path.sample(t)
        np.testing.assert_array_equal(sample.rotation, R)
        np.testing.assert_array_equal(sample.angular_velocity, np.zeros(3))
    half = path.sample(0.5).rotation
    np.testing.assert_allclose(
        pin.log3(R1.T @ half), pin.log3(R1.T @ R2) / 2, atol=1e-14
    )


def test_a_user_defined_trajectory() -> None:
    class Fall(Trajectory):
        height: Number

        @property
        def dimension(self) -> int:
            return 1

        def sample(
            self, t: float, out: TrajectorySample | None = None
        ) -> TrajectorySample:
            out = self._output(out)
            out.position[0] = self.height - 4.9 * t * t
            out.velocity[0] = -9.8 * t
            out.acceleration[0] = -9.8
            return out

    assert Blend(Fall(2.0), 1.0, start=[0.0]).sample(3.0).velocity == pytest.approx(
        -29.4
    )
    with pytest.raises(ImmutableError, match=r"^Fall.height cannot be assigned"):
        Fall(2.0).height = 3.0
    with pytest.raises(TrajectoryError, match=r"^Fall: height: 'high' is a str"):
        Fall("high")


MIRROR = np.diag([1.0, 1.0, -1.0])
# Single fields are in test_trajectory_values; these are combinations.
ERRORS: dict[str, Callable[[], Any]] = {
    "Line: end ... (2) ... (3,)": (
     lambda: Line([1, 2, 3], 1, start=[0, 0])),
    "UniformLine: velocity must have shape (2)": lambda: UniformLine([1], [0, 0]),
    "Circle: ... dimension 1 ... axes": lambda: Circle(1, 1, [0]),
    "Circle: give axes or a normal, not both": lambda: Circle(1, 1, [0, 0, 0],
     normal=[0, 0, 1], axes=np.eye(3)[:2]),
    "Circle: ... dimension 2 ... 3 ... normal": (
     lambda: Circle(1, 1, [0, 0], normal=[0, 0, 1])),
    "Circle: toward needs a normal": lambda: Circle(1, 1, [0] * 3, toward=[1, 0, 0]),
    "Circle: toward must not be parallel to normal": lambda: Circle(1, 1,
     normal=[0, 0, 1], toward=[0, 0, -2]),
    "Circle: ... orthonormal ... 3.0e+00": lambda: Circle(1,
     1, axes=[[2, 0], [0, 1]]),
    "Circle: axes ... (2, 3) ... (2, 2)": lambda: Circle(1, 1,
     [0, 0, 0], axes=np.eye(2)),
    "Lissajous: rates must have shape (1)": lambda: Lissajous([1], [1, 1]),
    "MinimumJerk: ... times[2] = 1.0 <= times[1] = 1": (
        lambda: MinimumJerk(np.zeros((3, 2)), [0, 1, 1], origin="start")
    ),
    "Spline: times ... (3) ... (2,)": (
     lambda: Spline(np.eye(3), [0, 1])),
    "MinimumJerk: ... two waypoints ... 1": (
     lambda: MinimumJerk([[1.0]], [0])),
    "PiecewisePolynomial: end must have shape (1)": (
     lambda: PiecewisePolynomial([0, 1], [[[1.0], [2.0]]], end=[1, 2])),
    "PiecewisePolynomial: times must have shape (2)": (
     lambda: PiecewisePolynomial([0, 1, 2], [[[1.0], [2.0]]])),
    "... function( ... (2) ... (3,)": (
     lambda: CallableTrajectory(swinging, 2).sample(0.5)),
    "... velocity(0.5) ... (3)": (
     lambda: CallableTrajectory(swinging, 3, lambda t: [t]).sample(0.5)),
    "... function( ... finite ... [nan]": (
     lambda: CallableTrajectory(lambda t: [np.nan], 1).sample(0.5)),
    "... function( ... numbers ... (1)": (
     lambda: CallableTrajectory(lambda t: ["here"], 1).sample(0.5)),
    "Blend: start ... (2) ... (3,)": lambda: Blend(CIRCLE, 1,
     start=[0] * 3),
    "HoldOrientation: rotation: ... orthonormal": (
     lambda: HoldOrientation(2 * IDENTITY)),
    "HoldOrientation: rotation: ... reflection": (
     lambda: HoldOrientation(MIRROR)),
    "HoldOrientation: rotation: ... norm 1 ... 2": (
        lambda: HoldOrientation([0, 0, 0, 2])
    ),
    "HoldOrientation: rotation: ... (2,) ... (3,) for roll": (
     lambda: HoldOrientation([1, 2])),
    "OrientationPath: rotations: ... [1] ... a rotation": (
     lambda: OrientationPath([IDENTITY, MIRROR], [0, 1])),
    "OrientationPath: ... times[1] = 0.0 <= times[0] = 0.0": (
     lambda: OrientationPath([R1, R2], [0, 0])),
    "... function(0) ... a rotation": (
     lambda: CallableOrientation(lambda t: MIRROR).sample(0.0)),
    "ComposedPose: position ... dimension 2": (
     lambda: ComposedPose(CIRCLE, SPIN)),
    "ScrewInterpolation: rotation: ... orthonormal": (
     lambda: ScrewInterpolation(POINTS[1], 2 * R1, 1)),
}  # fmt: skip


@pytest.mark.parametrize("message", ERRORS)
def test_bad_input_is_named(message: str) -> None:
    with pytest.raises(TrajectoryError, match=wording(message)):
        ERRORS[message]()


def test_every_member_is_tested() -> None:
    tested = {type(member).__name__ for member, _ in MEMBERS.values()}
    bases = (Trajectory, OrientationTrajectory, PoseTrajectory)
    public = {
        name
        for name, value in vars(family).items()
        if isinstance(value, type) and issubclass(value, bases) and value not in bases
    }
    streamed = {"Stream", "StreamOrientation", "StreamPose"}  # test_streams.py
    assert tested == public - streamed
