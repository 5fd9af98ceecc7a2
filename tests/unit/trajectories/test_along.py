"""Paths at a speed: x(t) = p(s(t)), exact rates, rest at the ends, refusals."""

import itertools
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from oracles import slope
from places import THOROUGH
from scipy.integrate import quad
from trajectory_cases import CORNER, IDENTITY, POINTS, R1, R2, R3, SPIN, TIMES
from wording import wording

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError
from hsp_control.engine.plans import planned
from hsp_control.engine.rotations import log3
from hsp_control.trajectories import (
    Along,
    AlongOrientation,
    AlongPose,
    Circle,
    ComposedPose,
    Hold,
    Line,
    Lissajous,
    MinimumJerk,
    OrientationPath,
    PiecewisePolynomial,
    Polyline,
    PolylinePose,
    PoseSample,
    Spin,
    Spline,
    Stops,
    Trajectory,
    TrajectorySample,
    UniformLine,
)

quick = settings(max_examples=25 if THOROUGH else 6)
seeds = st.integers(0, 10**6)


def some_curve(rng: np.random.Generator) -> Trajectory:
    """Return a spatial curve of any kind that has a beginning and an end."""
    points = rng.normal(size=(4, 3))
    times = np.cumsum(rng.uniform(0.5, 1.5, 4))
    lissajous = Lissajous(rng.normal(size=3), [1, 2, 3], rng.normal(size=3), [0] * 3)
    return [
        MinimumJerk(points, times),
        Spline(points, times, 7),
        Line(points[0], 2.0, start=points[1]),
        # from the middle of a figure on, so that it begins in motion
        Along(lissajous, 1.0, interval=[0.2, 0.2 + rng.uniform(1, 4)]),
    ][rng.integers(4)]


def gentle(curve: Trajectory, speed: float, acceleration: float) -> Along:
    """Return the motion along a curve, at the proposed speed if the given one is
    refused."""
    try:
        return Along(curve, speed, acceleration)
    except TrajectoryError as refused:
        return Along(curve, proposed(refused), acceleration)


def proposed(refused: Exception) -> float:
    found = re.search(r"speed = (\S+) would do", str(refused))
    assert found
    return float(found[1])


# --- the motion -----------------------------------------------------------------------


@quick
@given(seeds)
def test_rates_are_the_slopes_of_the_motion(seed: int) -> None:
    """Up to h⁶ f⁽⁷⁾/140, which grows with the curvature, and rounding of 1e-15/h."""
    rng = np.random.default_rng(seed)
    motion = gentle(some_curve(rng), 1.0, 2.0)
    start, end = motion.course.knots
    ramp = 1.5 * motion.speed / 2.0
    joints = [start, start + ramp, end - ramp, end]  # s''' jumps there
    h = 1e-3
    for t in rng.uniform(start, end, 20):
        x = motion.sample(t)
        if min(abs(t - each) for each in joints) < 4 * h:
            continue
        for i in (0, 1):
            found = slope(lambda tau, t=t, i=i: motion.sample(t + tau)[i], h)
            np.testing.assert_allclose(x[i + 1], found, rtol=0, atol=1e-10)


@quick
@given(seeds)
def test_speed_is_the_trapezoid_for_any_curve(seed: int) -> None:
    """|x'| is s', and the part of x'' along the path s'', to rounding."""
    rng = np.random.default_rng(seed)
    motion = gentle(some_curve(rng), *rng.uniform(0.3, 2.0, 2))
    start, end = motion.course.knots
    length = motion._pace.scaling.length
    v, a = motion._pace.scaling.speed, motion.acceleration
    ramp = 1.5 * v / a
    assert end - start == pytest.approx(ramp + length / v)
    for t in rng.uniform(start, end, 20):
        x = motion.sample(t)
        u = min(min(t - start, end - t) / ramp, 1.0)
        speed = v * u * u * (3.0 - 2.0 * u)
        np.testing.assert_allclose(np.linalg.norm(x.velocity), speed, rtol=1e-12)
        rate = 4.0 * a * u * (1.0 - u) * (1.0 if t < (start + end) / 2 else -1.0)
        along = x.acceleration @ x.velocity / speed
        np.testing.assert_allclose(along, rate, rtol=0, atol=1e-11 * a)


@quick
@given(seeds)
def test_place_is_the_length_along_the_path(seed: int) -> None:
    """SciPy's integral of |p'| to some u is the s at which p(u) is passed."""
    rng = np.random.default_rng(seed)
    points, times = rng.normal(size=(3, 3)), np.cumsum(rng.uniform(0.5, 1.5, 3))
    curve = MinimumJerk(points, times)
    speed = rng.uniform(0.3, 2.0)
    motion = Along(curve, speed, start_time=-1.0)
    u = rng.uniform(times[0], times[-1])
    length, _ = quad(
        lambda u: np.linalg.norm(curve.sample(u).velocity),
        times[0],
        u,
        epsabs=1e-13,
        epsrel=1e-13,
        limit=500,
        points=[times[1]] if u > times[1] else None,
    )
    place = motion.sample(length / speed - 1.0).position
    np.testing.assert_allclose(place, curve.sample(u).position, rtol=0, atol=1e-11)


@quick
@given(seeds)
def test_it_rests_at_both_ends_and_begins_gently(seed: int) -> None:
    rng = np.random.default_rng(seed)
    curve = some_curve(rng)
    motion = Along(curve, 1.0, 1e3, start_time=rng.normal())
    start, end = motion.course.knots
    first, last = curve.course.knots[[0, -1]]
    for t, u in ((start - 1, first), (start, first), (end, last), (end + 1, last)):
        x = motion.sample(t)
        np.testing.assert_array_equal(x.position, curve.sample(u).position)
        np.testing.assert_array_equal([x.velocity, x.acceleration], np.zeros((2, 3)))
    ramp = 1.5 * 1.0 / 1e3
    for joint in (start, start + ramp, end - ramp, end):  # x'' is continuous
        a, b = (motion.sample(joint + k * 1e-9).acceleration for k in (-1, 1))
        jump = 4 * 1e3 / ramp * 2e-9  # the largest s''' is 4 a/T
        np.testing.assert_allclose(a, b, rtol=1e-3, atol=2 * jump)


@pytest.mark.parametrize("rate", [3.0, -0.7])
def test_a_circle_at_a_speed_is_the_circle_at_its_rate(rate: float) -> None:
    fast = Along(
        Circle(0.4, np.sign(rate) * 2.0, [0, 1, 2], phase=0.3), 0.4 * abs(rate)
    )
    own = Circle(0.4, rate, [0, 1, 2], phase=0.3)
    for t in np.linspace(-5, 60, 40):  # 30 turns: 1e-15 each, times ω² r
        for a, b in zip(fast.sample(t), own.sample(t), strict=True):
            np.testing.assert_allclose(a, b, rtol=0, atol=1e-12)


def test_an_endless_motion_only_accelerates() -> None:
    line = Along(UniformLine([3.0, 4.0], [1.0, 1.0]), 2.0, 1.5)
    for t, s in ((-1.0, 0.0), (0.0, 0.0), (2.0, 2.0), (1e3, 2.0 * (1e3 - 1.0))):
        expected = np.array([1.0, 1.0]) + s * np.array([0.6, 0.8])
        np.testing.assert_allclose(line.sample(t).position, expected, rtol=1e-14)
    assert line.course is None


@pytest.mark.parametrize(
    ("rates", "turns"), [([1.2, -0.8], 1 / 0.4), ([2.0, 0.0], 0.5), ([3, 4.5], 1 / 1.5)]
)
def test_a_lissajous_figure_repeats_after_its_period(
    rates: list[float], turns: float
) -> None:
    course = Lissajous([1, 2], rates, [0.3, 0.2], [0, 0]).course
    assert course is not None
    assert course.repeats
    np.testing.assert_allclose(course.knots, [0.0, 2 * np.pi * turns], rtol=1e-15)
    assert Lissajous([1, 2], [1.0, np.sqrt(2)], center=[0, 0]).course is None


def test_a_path_that_is_too_short_stays_below_its_speed() -> None:
    line = Along(Line([0.0], 1.0, start=[0.6]), 5.0, 1.0)
    end = line.course.knots[-1]
    middle = line.sample(end / 2)
    # two ramps over 0.3 each: v T/2 = 0.3, T = 1.5 v/a
    np.testing.assert_allclose(middle.velocity, [-np.sqrt(0.6 / 1.5)], rtol=1e-12)
    np.testing.assert_allclose(middle.position, [0.3], rtol=1e-12)
    peak = max(abs(line.sample(t).acceleration[0]) for t in np.linspace(0, end, 2001))
    assert 0.999 < peak <= 1.0 + 1e-12


# --- poses ----------------------------------------------------------------------------


def test_a_pose_keeps_pace_with_its_origin() -> None:
    path = ComposedPose(
        Line([1.0, 0, 0], 1.0, start=[0, 0, 0]), OrientationPath([R1, R2], [0, 1])
    )
    motion = AlongPose(path, 0.5, 1.0)
    start, end = motion.course.knots
    turned = np.linalg.norm(log3(R1.T @ R2))
    for t in np.linspace(start, end, 30):
        position, orientation = motion.sample(t)
        s = position.position[0]
        angle = np.linalg.norm(log3(R1.T @ orientation.rotation))
        np.testing.assert_allclose(angle, s * turned, rtol=0, atol=1e-12)
        speed = np.linalg.norm(orientation.angular_velocity)
        np.testing.assert_allclose(speed, turned * position.velocity[0], atol=1e-9)


def test_a_pose_whose_origin_stays_has_a_speed_of_its_angle() -> None:
    turn = OrientationPath([R1, R2], [0.0, 1.0])
    pose = AlongPose(ComposedPose(Hold([1, 2, 3]), turn), 0.5, 1.0)
    alone = AlongOrientation(turn, 0.5, 1.0)
    middle = float(np.mean(alone.course.knots))
    assert np.linalg.norm(alone.sample(middle).angular_velocity) == pytest.approx(0.5)
    for t in np.linspace(*alone.course.knots, 20):
        for a, b in zip(pose.sample(t).orientation, alone.sample(t), strict=True):
            np.testing.assert_array_equal(a, b)
    spin = AlongOrientation(SPIN, 2.5 * np.sqrt(1))
    np.testing.assert_allclose(
        spin.sample(7.3).rotation, SPIN.sample(7.3).rotation, atol=1e-13
    )


# --- waypoints ------------------------------------------------------------------------


@quick
@given(seeds)
def test_a_polyline_is_on_its_lines_but_for_blends(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.normal(size=(5, 3)), axis=0)
    radius = 0.4 * np.linalg.norm(np.diff(points, axis=0), axis=1).min()
    motion = Polyline(points, 1.0, 1e6, radius)
    for t in rng.uniform(*motion.course.knots, 40):
        x, x_dot, _ = motion.sample(t)
        np.testing.assert_allclose(np.linalg.norm(x_dot), 1.0, rtol=1e-12)
        near = np.linalg.norm(points - x, axis=1).min() < radius
        away = min(_distance(x, a, b) for a, b in itertools.pairwise(points))
        assert away < (radius if near else 1e-12)
    for t, i in zip(motion.course.knots, (0, -1), strict=True):
        np.testing.assert_allclose(motion.sample(t).position, points[i], atol=1e-14)


def _distance(x: Array, a: Array, b: Array) -> float:
    """Return the distance from x to the line from a to b."""
    share = np.clip((x - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
    return float(np.linalg.norm(x - a - share * (b - a)))


@pytest.mark.parametrize("degrees", [10, 60, 90, 135, 170])
def test_bends_are_as_wide_as_documented(degrees: float) -> None:
    """Its smallest radius is at least two thirds of that of the inscribed arc."""
    angle = np.radians(degrees)
    corner = [[-1.0, 0.0], [0.0, 0.0], [np.cos(angle), np.sin(angle)]]
    motion = Polyline(corner, 1.0, 1e6, 0.5)
    times = np.linspace(*motion.course.knots, 4001)[1:-1]
    samples = [motion.sample(t) for t in times]
    bend = max(np.linalg.norm(x.acceleration) for x in samples)
    assert 1.0 < bend * 0.5 / np.tan(angle / 2) < 1.5
    if degrees == 90:
        assert 1 / bend == pytest.approx(0.84 * 0.5, abs=2e-3)
        nearest = min(np.linalg.norm(x.position) for x in samples)
        assert nearest == pytest.approx(0.36 * 0.5, abs=1e-3)


def test_poses_pass_their_waypoints_in_their_orientations() -> None:
    """The orientation is constant there; a single line needs no blend."""
    motion = PolylinePose(CORNER, 1.0, 5.0, 0.3, rotations=[R1, R2, R3])
    start, end = motion.course.knots
    for t, R in ((start, R1), ((start + end) / 2, R2), (end, R3)):
        orientation = motion.sample(t).orientation
        np.testing.assert_allclose(orientation.rotation, R, atol=1e-12)
        np.testing.assert_allclose(orientation.angular_velocity, 0.0, atol=1e-12)
    alike = Polyline(CORNER, 1.0, 5.0, 0.3)
    for t in np.linspace(start, end, 20):
        for a, b in zip(motion.sample(t).position, alike.sample(t), strict=True):
            np.testing.assert_array_equal(a, b)


def test_waypoints_are_relative_to_the_start() -> None:
    here = hsp.trajectories.HoldPose([1.0, 2.0, 3.0], R1)
    motion = PolylinePose(CORNER, 1.0, 5.0, 0.3, origin="start")
    with pytest.raises(TrajectoryError, match="depends on where the robot starts"):
        motion.sample(0.0)
    anchored = motion.anchored(pin.SE3(R1, np.array([1.0, 2.0, 3.0])))
    for a, b in zip(anchored.sample(0.0), here.sample(0.0), strict=True):
        for x, y in zip(a, b, strict=True):
            np.testing.assert_allclose(x, y, atol=1e-15)
    point = Polyline(CORNER, 1.0, 5.0, 0.3, origin="start").anchored([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(point.sample(0.0).position, [1.0, 2.0, 3.0])


# --- refusals -------------------------------------------------------------------------

LINES = [[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [0.0, 1.0]]]
REFUSED: dict[str, Callable[[], Any]] = {
    "Along: at s = 2.580 ... stops (at 0.9 s)": (
     lambda: Along(Stops(POINTS, TIMES), 1.0)),
    "Along: at s = 1.000 ... (its own time is 1 s) ... corner": (
     lambda: Along(PiecewisePolynomial([0, 1, 2], LINES), 1.0)),
    "Along: at s = 1.414 ... 0.7854 s) ... corner or turns back": (
     lambda: Along(Lissajous([1, 1], [2, 2], center=[0, 0]), 1.0)),
    "Along: at s = 0.000 ... stops (at 0 s)": (
     lambda: Along(hsp.trajectories.Blend(UniformLine([1.0], [0.0]), 0.1, start=[0.0],
                                          start_time=1.0), 1.0, interval=[0, 2])),
    "Along: the path has no length": lambda: Along(Hold([1.0]), 1.0, interval=[0, 1]),
    "Along: ... CallableTrajectory ... give interval": (
     lambda: Along(hsp.trajectories.CallableTrajectory(np.sin, 1), 1.0)),
    "Along: ... 0 to 1 s ... [0, 2]": (
     lambda: Along(Line([1], 1, start=[0]), 1, interval=[0, 2])),
    "Along: interval ... [1, 1]": (
     lambda: Along(Line([1], 1, start=[0]), 1, interval=[1, 1])),
    "Along: at s = 0.000 ... radius of 0.5 ... 8 across ... speed = 1 would do": (
     lambda: Along(Circle(0.5, 1, [0, 0]), 2.0, 2.0)),
    "origin: start cannot move a Along": (
     lambda: Along(Circle(0.5, 1), 1.0, origin="start").anchored([0, 0, 0])),
    "Polyline: waypoint 1 ... 90 degrees ... blend_radius": (
     lambda: Polyline(CORNER, 1, 1)),
    "Polyline: the path turns back at waypoint 1": (
     lambda: Polyline([[0.0], [1.0], [0.5]], 1, 1, 0.1)),
    "Polyline: waypoints 0 and 1 ... same point": (
     lambda: Polyline([[0.0, 0.0]] * 2, 1, 1)),
    "Polyline: a path needs at least two waypoints": lambda: Polyline([[0.0]], 1, 1),
    "Polyline: one blend ... 0 and 1 ... blend_radius = 1 would": (
     lambda: Polyline(CORNER, 1, 1, 1.1)),
    "Polyline: two blends ... 1 and 2 ... blend_radius = 0.5 would": (
     lambda: Polyline([*CORNER, [0, 1, 1]], 1, 1, 0.6)),
    "Polyline: at s = 0.9 ... radius of 0.0839 ... 2.98 ... speed = 0.289 would do": (
     lambda: Polyline(CORNER, 0.5, 1, 0.1)),
    "PolylinePose: 3 waypoints ... 2": (
     lambda: PolylinePose(CORNER, 1, 9, 0.3, rotations=[R1, R2])),
    "AlongPose: ... its own motion stops": (
     lambda: AlongPose(ComposedPose(Stops(POINTS[:3], [0, 1, 2]),
                                    OrientationPath([R1, R2], [0, 2])), 1)),
    "AlongPose: at s = 1.000 ... stops (at 1 s)": (
     lambda: AlongPose(ComposedPose(Line([1, 0, 0], 1, start=[0, 0, 0]),
                                    OrientationPath([R1, R2], [0, 2])), 1)),
    "AlongOrientation: ... stops (at 1 s)": (
     lambda: AlongOrientation(OrientationPath([IDENTITY, R1, R2], [0, 1, 2]), 1.0)),
}  # fmt: skip


@pytest.mark.parametrize("message", REFUSED)
def test_refusals_have_the_place_and_a_remedy(message: str) -> None:
    with pytest.raises(TrajectoryError, match=wording(message)):
        REFUSED[message]()


@quick
@given(seeds)
def test_the_speed_that_is_proposed_would_do(seed: int) -> None:
    """It is the highest within some percent: 1.1 times as much is refused."""
    rng = np.random.default_rng(seed)
    curve = some_curve(rng)
    if isinstance(curve, Line):
        return
    with pytest.raises(TrajectoryError, match="would do") as refused:
        Along(curve, 50.0, 0.5)
    speed = proposed(refused.value)
    motion = Along(curve, speed, 0.5)
    times = np.linspace(*motion.course.knots, 500)
    for t in times:
        x = motion.sample(t)
        v = np.linalg.norm(x.velocity)
        across = x.acceleration - x.velocity * (x.velocity @ x.acceleration) / max(
            v * v, 1e-300
        )
        if v > 1e-6:
            assert np.linalg.norm(across) <= 0.5 * 1.01  # between sample points
    with pytest.raises(TrajectoryError, match="would do"):
        Along(curve, 1.1 * speed, 0.5)


# --- in a step ------------------------------------------------------------------------


def test_no_step_calls_python() -> None:
    sample = TrajectorySample.allocate(3)
    (call,) = planned(Along(MinimumJerk(POINTS, TIMES), 1.0).calls(sample)).follow
    assert not call.python
    (call,) = planned(
        AlongPose(
            ComposedPose(Circle(1, 1, [0, 0, 0]), Spin([0, 0, 1], 1.0, rotation=R1)),
            1.0,
        ).calls(PoseSample.allocate())
    ).follow
    assert not call.python


@pytest.mark.parametrize(
    "trajectory",
    [
        "{type: polyline, origin: start, waypoints: [[0, 0, 0], [0.1, 0, 0], "
        "[0.1, 0.1, 0]], blend_radius: 0.03, speed: 0.1, acceleration: 0.5}",
        "{type: along, speed: 0.2, path: {type: circle, radius: 0.1, angular_rate: 1}}",
        "{type: along_pose, speed: 0.2, acceleration: 0.5, path: {type: composed, "
        "position: {type: circle, radius: 0.1, angular_rate: 1}}}",
        "{type: polyline_pose, origin: start, waypoints: [[0, 0, 0], [0.1, 0, 0], "
        "[0.1, 0.1, 0]], blend_radius: 0.03, speed: 0.1, acceleration: 0.5}",
    ],
)
def test_a_robot_follows_a_trajectory_from_yaml(
    trajectory: str, tmp_path: Path
) -> None:
    file = tmp_path / "path.yaml"
    file.write_text(
        "robot: {name: panda}\ntasks:\n  hand: {type: frame_pose, frame: panda_tcp, "
        f"trajectory: {trajectory}}}\n"
    )
    controller = hsp.load_experiment(file).controller
    q = controller.robot.home()
    controller.compute(0.0, q, np.zeros(7))
    assert not controller.step_plan.python
