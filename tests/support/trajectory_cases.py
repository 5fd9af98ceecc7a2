"""Trajectories of every kind, for tests of their motion and of their values."""

from math import cos, sin
from typing import Any

import numpy as np
import pinocchio as pin

import hsp_control as hsp
from hsp_control.common.arrays import Array


def pose(seed: int) -> pin.SE3:
    rng = np.random.default_rng(seed)
    return pin.SE3(pin.exp3(rng.uniform(-1.5, 1.5, 3)), rng.normal(size=3))


def screw(
    start: pin.SE3, end: pin.SE3, duration: float, start_time: float = 0.0
) -> hsp.trajectories.ScrewInterpolation:
    """Return the screw motion between two poses."""
    return hsp.trajectories.ScrewInterpolation(
        end.translation,
        end.rotation,
        duration,
        start_time=start_time,
        start_position=start.translation,
        start_rotation=start.rotation,
    )


def swinging(t: float) -> list[float]:
    return [sin(2 * t), t * t, cos(t)]


def swinging_velocity(t: float) -> list[float]:
    return [2 * cos(2 * t), 2 * t, -sin(t)]


def swinging_acceleration(t: float) -> list[float]:
    return [-4 * sin(2 * t), 2.0, -cos(t)]


def nodding(t: float) -> Array:
    R: Array = pin.exp3(np.array([sin(t), 0.5 * t, 0.3])) @ R1
    return R


IDENTITY = np.eye(3)
R1, R2, R3 = (pose(seed).rotation for seed in (1, 2, 3))
POINTS = np.random.default_rng(4).normal(size=(4, 3))
TIMES = [0.2, 0.9, 1.4, 2.2]
LISSAJOUS = hsp.trajectories.Lissajous([0.5, -1, 2], [1, 2, 3], [0, 1, 2], [1, 2, 3])
CIRCLE = hsp.Circle(1, 3, [1, 1])
SPIN = hsp.trajectories.Spin([1, -2, 0.5], 2.5, rotation=R1)
BLENDED_SPIN = hsp.trajectories.BlendOrientation(
    SPIN, 1.5, rotation=R2, start_angular_velocity=[0.1, -0.4, 0.2], start_time=0.5
)

# Members, and their knots: times at which pieces or holds meet.
POINT_MEMBERS: dict[str, tuple[hsp.trajectories.Trajectory, list[float]]] = {
    "hold": (hsp.Hold([1, 2, 3, 4]), []),
    "line": (hsp.Line([3, -1], 1.5, start=[0, 1], start_time=0.5), [0.5, 2.0]),
    "uniform line": (hsp.trajectories.UniformLine([0.3, 0.2, -1], [1, 0, 2]), []),
    "circle": (CIRCLE, []),
    "circle across a normal": (
        hsp.Circle(0.4, 2, [0, 1, 2], phase=0.3, normal=[1, 2, 2]),
        [],
    ),
    "circle from a start": (
        hsp.Circle(0.4, -2, [0, 1, 2], normal=[0, 0, 3], toward=[0, 2, 1]),
        [],
    ),
    "circle in axes": (hsp.Circle(2, 1, np.zeros(4), axes=np.eye(4)[[3, 1]]), []),
    "lissajous": (LISSAJOUS, []),
    "minimum jerk": (hsp.trajectories.MinimumJerk(POINTS, TIMES), TIMES),
    "stops": (hsp.trajectories.Stops(POINTS, TIMES), TIMES),
    "minimum jerk of two": (
        hsp.trajectories.MinimumJerk(POINTS[:2], TIMES[:2]),
        TIMES[:2],
    ),
    "spline 3": (hsp.trajectories.Spline(POINTS, TIMES, 3), TIMES),
    "spline 5": (hsp.trajectories.Spline(POINTS, TIMES), TIMES),
    "spline 7": (hsp.trajectories.Spline(POINTS, TIMES, 7), TIMES),
    "polynomial": (
        hsp.trajectories.PiecewisePolynomial([0.5, 2], [[[1.0], [2.0], [-3.0], [0.5]]]),
        [0.5, 2],
    ),
    "callable": (hsp.trajectories.CallableTrajectory(swinging, 3), []),
    "callable with velocity": (
        hsp.trajectories.CallableTrajectory(swinging, 3, swinging_velocity),
        [],
    ),
    "callable with both": (
        hsp.trajectories.CallableTrajectory(
            swinging, 3, swinging_velocity, swinging_acceleration
        ),
        [],
    ),
    "callable with acceleration": (
        hsp.trajectories.CallableTrajectory(
            swinging, 3, acceleration=swinging_acceleration
        ),
        [],
    ),
    "blend": (
        hsp.trajectories.Blend(CIRCLE, 1.0, start=[0, 3], start_time=0.5),
        [0.5, 1.5],
    ),
    "blend in motion": (
        hsp.trajectories.Blend(CIRCLE, 1.5, start=[0, 3], start_velocity=[1, -2]),
        [0.0, 1.5],
    ),
}
POINT_MEMBERS["crossfade"] = (
    hsp.trajectories.Crossfade(
        CIRCLE, hsp.Line([3, -1], 4.0, start=[0, 1]), start_time=0.5, duration=1.0
    ),
    [0.5, 1.5],
)
# The paths below are followed at a speed; knots are the ends of ramps and of blends.
CORNER = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0]]
POLYLINE = hsp.trajectories.Polyline(CORNER, 1.0, 5.0, 0.3)
_END = POLYLINE.course.knots[-1]
POLYLINE_KNOTS = [0.0, 0.3, 0.85, _END - 0.85, _END - 0.3, _END]


def ends(member: Any) -> list[float]:
    """Return the times at which a motion along a path begins, cruises, brakes and
    ends."""
    start, end = member.course.knots
    ramp = 1.5 * member.speed / member.acceleration
    return [start, start + ramp, end - ramp, end]


def along(path: hsp.trajectories.Trajectory, speed: float, acceleration: float) -> Any:
    member = hsp.trajectories.Along(path, speed, acceleration, start_time=0.2)
    return member, ends(member)


POINT_MEMBERS |= {
    "along a circle": (hsp.trajectories.Along(CIRCLE, 0.8), []),
    "along a circle from rest": (
        hsp.trajectories.Along(CIRCLE, 0.8, 1.0, start_time=0.5),
        [0.5, 1.7],
    ),
    "along a line": along(hsp.Line([3, -1], 1.5, start=[0, 1]), 2.0, 5.0),
    "along a lissajous figure": (hsp.trajectories.Along(LISSAJOUS, 2.0), []),
    "along a parabola": (
        hsp.trajectories.Along(
            hsp.trajectories.PiecewisePolynomial(
                [0, 2], [[[0.0, 0.0], [1.0, 0.5], [0.3, -1.0]]]
            ),
            0.7,
            start_time=0.5,
        ),
        [0.5, 0.5 + 1.4786624709008984 / 0.7],
    ),
    "along a function": (
        hsp.trajectories.Along(
            hsp.trajectories.CallableTrajectory(
                swinging, 3, swinging_velocity, swinging_acceleration
            ),
            1.5,
            interval=[0.0, 9.0],
        ),
        [0.0],
    ),
    "polyline": (POLYLINE, POLYLINE_KNOTS),
}
ORIENTATION_MEMBERS: dict[
    str, tuple[hsp.trajectories.OrientationTrajectory, list[float]]
] = {
    "hold orientation": (hsp.trajectories.HoldOrientation(R1), []),
    "spin": (SPIN, []),
    "orientation path": (
        hsp.trajectories.OrientationPath([R1, R2, R3], TIMES[:3]),
        TIMES[:3],
    ),
    "callable orientation": (hsp.trajectories.CallableOrientation(nodding), []),
    "blend orientation": (
        hsp.trajectories.BlendOrientation(SPIN, 1.5, rotation=R2, start_time=0.5),
        [0.5, 2.0],
    ),
    "blend orientation in motion": (BLENDED_SPIN, [0.5, 2.0]),
    "crossfade orientation": (
        hsp.trajectories.CrossfadeOrientation(
            SPIN, BLENDED_SPIN, start_time=0.5, duration=1.0
        ),
        [0.5, 1.5, 2.0],
    ),
    "along a spin": (
        hsp.trajectories.AlongOrientation(SPIN, 1.0, 2.0, start_time=0.5),
        [0.5, 1.25],
    ),
}
_TURN = hsp.trajectories.OrientationPath([R1, R2], TIMES[:2])
ALONG_TURN = hsp.trajectories.AlongOrientation(_TURN, 1.5, 3.0)
ORIENTATION_MEMBERS["along a turn"] = (ALONG_TURN, ends(ALONG_TURN))
POSE_MEMBERS: dict[str, tuple[hsp.trajectories.PoseTrajectory, list[float]]] = {
    "composed pose": (hsp.trajectories.ComposedPose(LISSAJOUS, SPIN), []),
    "hold pose": (hsp.trajectories.HoldPose(POINTS[0], R1), []),
    "screw": (screw(pose(5), pose(6), 1.5, 0.5), [0.5, 2.0]),
    "screw without turn": (
        screw(pin.SE3(R1, POINTS[0]), pin.SE3(R1, POINTS[1]), 1.0),
        [0.0, 1.0],
    ),
    "along a composed pose": (
        hsp.trajectories.AlongPose(
            hsp.trajectories.ComposedPose(LISSAJOUS, SPIN), 1.0, interval=[0.5, 4.0]
        ),
        [0.0],
    ),
    "polyline pose": (
        hsp.trajectories.PolylinePose(CORNER, 1.0, 5.0, 0.3, rotations=[R1, R2, R3]),
        [*POLYLINE_KNOTS, _END / 2],
    ),
}
for _name, _path in (
    ("along a screw", screw(pose(5), pose(6), 1.5, 0.5)),
    (
        "along a turn of a pose",
        hsp.trajectories.ComposedPose(hsp.Hold(POINTS[0]), _TURN),
    ),
):
    _member = hsp.trajectories.AlongPose(_path, 1.5, 3.0)
    POSE_MEMBERS[_name] = (_member, ends(_member))
MEMBERS: dict[str, tuple[Any, list[float]]] = {
    **POINT_MEMBERS,
    **ORIENTATION_MEMBERS,
    **POSE_MEMBERS,
}


def flat(sample: Any) -> list[Array]:
    """Return the arrays of any sample, pose samples included."""
    if isinstance(sample, hsp.trajectories.PoseSample):
        return [*sample.position, *sample.orientation]
    return list(sample)
