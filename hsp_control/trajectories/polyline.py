"""Straight lines through waypoints with rounded corners, at a speed along them."""

from dataclasses import KW_ONLY, replace
from functools import cached_property
from math import pi, tan
from typing import ClassVar, Literal, NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError
from hsp_control.declaration.quantities import (
    Matrix,
    NonNegative,
    Number,
    Positive,
)
from hsp_control.declaration.rotation import Rotations
from hsp_control.engine.plans import TIME, PartCall, PartCalls
from hsp_control.trajectories import checks
from hsp_control.trajectories.along import (
    Pace,
    course_of,
    pace,
    point_call,
    point_rates,
    pose_call,
    pose_pace,
)
from hsp_control.trajectories.arc_length import Course
from hsp_control.trajectories.hold import HoldOrientation
from hsp_control.trajectories.orientation import OrientationPath
from hsp_control.trajectories.piecewise_polynomial import QUINTIC, PiecewisePolynomial
from hsp_control.trajectories.pose import ComposedPose, PoseSample, PoseTrajectory
from hsp_control.trajectories.trajectory import Trajectory

STRAIGHT = 1e-9  # angle [rad] between two lines below which they are one
BACK = pi - 1e-6  # angle from which on they reverse


class RoundedLines(NamedTuple):
    """Lines and blends, with a parameter u that is nearly their length."""

    path: PiecewisePolynomial
    passing: Array  # u at which each waypoint is passed, (m,)


def rounded_lines(waypoints: Array, radius: float) -> RoundedLines:
    """Return lines through waypoints, shape (m, n), with rounded corners.

    A blend is a quintic from the distance ``radius`` before a waypoint to the same
    distance after it; its velocity is that of the lines at both ends, and its second
    derivative zero, so that the path is C². In u it is as long as the arc of a circle
    that would fit: |dp/du| is then 0.9 to 1.2 for angles up to 170°.
    """
    if len(waypoints) < 2:
        raise TrajectoryError("a path needs at least two waypoints; it has 1")
    lines = np.diff(waypoints, axis=0)
    lengths = np.linalg.norm(lines, axis=1)
    for i, length in enumerate(lengths):
        if not length > 0.0:
            raise TrajectoryError(
                f"waypoints {i} and {i + 1} are the same point; a polyline does not "
                "pause: use stops"
            )
    directions = lines / lengths[:, np.newaxis]
    angles = _angles(directions)
    cut = np.where(angles > STRAIGHT, radius, 0.0)  # of the lines, at every waypoint
    _check(angles, cut, lengths)

    times, passing, coefficients = [0.0], [0.0], []
    rest = np.zeros(waypoints.shape[1])
    for i, (start, along) in enumerate(zip(waypoints, directions, strict=False)):
        straight = lengths[i] - cut[i] - cut[i + 1]
        if straight > 1e-12 * lengths[i]:  # otherwise one blend follows the other
            line = [start + cut[i] * along, straight * along, *[rest] * 4]
            coefficients.append(np.stack(line))
            times.append(times[-1] + straight)
        d, corner = cut[i + 1], waypoints[i + 1]
        if not d > 0.0:
            passing.append(times[-1])
            continue
        width = d * angles[i + 1] / tan(angles[i + 1] / 2.0)
        after = directions[i + 1]
        ends = [corner - d * along, width * along, rest]
        ends += [corner + d * after, width * after, rest]
        coefficients.append(QUINTIC @ np.stack(ends))
        passing.append(times[-1] + width / 2.0)
        times.append(times[-1] + width)
    path = PiecewisePolynomial(times, np.stack(coefficients), end=waypoints[-1])
    return RoundedLines(path, np.array(passing))


def _angles(directions: Array) -> Array:
    """Return the angles [rad] between lines at the waypoints; 0 at both ends."""
    cosines = np.einsum("ij,ij->i", directions[1:], directions[:-1])
    sines = np.linalg.norm(directions[1:] - cosines[:, None] * directions[:-1], axis=1)
    return np.concatenate([[0.0], np.arctan2(sines, cosines), [0.0]])


def _check(angles: Array, cut: Array, lengths: Array) -> None:
    for i, angle in enumerate(angles):
        if angle > BACK:
            raise TrajectoryError(
                f"the path turns back at waypoint {i}: it can only be passed at rest; "
                "use stops, or a waypoint beside it"
            )
        if angle > STRAIGHT and not cut[i] > 0.0:
            raise TrajectoryError(
                f"waypoint {i} is a corner of {np.degrees(angle):.3g} degrees: it can "
                "only be passed at rest; give blend_radius, or use stops"
            )
    for i, length in enumerate(lengths):
        if cut[i] + cut[i + 1] > length * (1.0 + 1e-12):
            blends = "two blends do" if cut[i] * cut[i + 1] > 0.0 else "one blend does"
            fits = length / (2 if cut[i] * cut[i + 1] > 0.0 else 1)
            raise TrajectoryError(
                f"{blends} not fit between waypoints {i} and {i + 1}, which are "
                f"{length:.4g} apart; blend_radius = {fits:.4g} would"
            )


class Polyline(Trajectory, type="polyline"):
    """Straight lines through waypoints with rounded corners, at a speed along them.

    It begins at the first waypoint and ends at the last. Within the blend radius of an
    inner waypoint the path is rounded by a polynomial whose curvature begins and ends
    at zero; at a right angle the path passes a waypoint at 0.36 radii, and its sharpest
    bend has a radius of 0.84. The motion is C² and goes from rest to rest; see `Along`
    for its speed. `Stops` rests at every waypoint.

    Raises:
        TrajectoryError: At a corner that is not rounded, if a blend does not fit, or if
        a bend needs more than the acceleration across it. The message gives the place,
        and a feasible value.
    """

    points: ClassVar[tuple[str, ...]] = ("waypoints",)

    waypoints: Matrix
    """At least two points, shape (m, n) [m, or the task's unit]."""
    speed: Positive
    """Largest speed v along the path [m/s, or the task's unit per s]."""
    acceleration: Positive
    """Largest acceleration along the path, and across it in bends [m/s², or the task's
    unit per s²]."""
    blend_radius: NonNegative = 0.0
    """Distance from a waypoint at which its rounding begins and ends [m, or the task's
    unit]."""
    _: KW_ONLY
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""

    def __post_init__(self) -> None:
        """Measure the path, which checks it; it is the same wherever it begins."""
        self._pace  # noqa: B018 (computed, checked and kept)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return int(np.shape(self.waypoints)[1])

    @property
    def course(self) -> Course | None:
        """From its start to its end."""
        return course_of(self._pace)

    @cached_property
    def _path(self) -> PiecewisePolynomial:
        return rounded_lines(np.asarray(self.waypoints), self.blend_radius).path

    @cached_property
    def _pace(self) -> Pace:
        return pace(point_rates(self._path), self._path.course, self)

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        return point_call(self._path, self._pace)


class PolylinePose(PoseTrajectory, type="polyline_pose"):
    """Poses along a `Polyline` of the origin, at a speed of the origin.

    Between two waypoints the body rotates by the shortest rotation, by the
    `smooth_step` of the distance: its angular velocity is zero at every waypoint, and
    the motion is C².
    """

    waypoints: Matrix
    """Positions of the origin, at least two, shape (m, 3) [m]."""
    speed: Positive
    """Largest speed v of the origin [m/s]."""
    acceleration: Positive
    """Largest acceleration of the origin along its path, and across it in bends
    [m/s²]."""
    blend_radius: NonNegative = 0.0
    """Distance from a waypoint at which its rounding begins and ends [m]."""
    _: KW_ONLY
    rotations: Rotations | None = None
    """An orientation per waypoint, body to world: roll, pitch and yaw [rad], a
    quaternion or a matrix [-]; held at the robot's start by default."""
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""
    origin: Literal["world", "start"] = "world"
    """Origin of the waypoints: the world's, or the robot's start."""

    def __post_init__(self) -> None:
        """Measure the path, which checks it; it is the same wherever it begins."""
        self._pace  # noqa: B018 (computed, checked and kept)

    @property
    def relative(self) -> bool:
        """Whether it depends on the robot's start."""
        return self.origin == "start" or self.rotations is None

    def anchored(self, start: pin.SE3) -> "PolylinePose":
        """Return the motion from a start pose; see `PoseTrajectory.anchored`."""
        waypoints, rotations = np.asarray(self.waypoints), self.rotations
        if self.origin == "start":
            waypoints = waypoints + start.translation
        if rotations is None:
            rotations = [start.rotation] * len(waypoints)
        return replace(self, waypoints=waypoints, rotations=rotations, origin="world")

    @property
    def course(self) -> Course | None:
        """From its start to its end."""
        return course_of(self._pace[0])

    @cached_property
    def _path(self) -> ComposedPose:
        waypoints = checks.array(self.waypoints, "waypoints", (None, 3))
        path, passing = rounded_lines(waypoints, self.blend_radius)
        if self.rotations is None:  # the length of the path is known nevertheless
            return ComposedPose(path, HoldOrientation(np.eye(3)))
        rotations = np.asarray(self.rotations)
        if len(rotations) != len(waypoints):
            raise TrajectoryError(
                f"{len(waypoints)} waypoints need as many rotations; there are "
                f"{len(rotations)}"
            )
        return ComposedPose(path, OrientationPath(rotations, passing))

    @cached_property
    def _pace(self) -> tuple[Pace, bool]:
        course = self._path.course
        assert course is not None
        return pose_pace(self._path, course, self)

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        if self.relative:
            raise TrajectoryError(
                "PolylinePose depends on where the robot starts, which only a "
                "controller knows; give rotations, and waypoints in the world"
            )
        out = self._output(out)
        engine.AlongPose(**self._call().arguments, out=out)(float(t))
        return out

    def calls(self, out: PoseSample) -> PartCalls:
        """Return the call that writes ``out``; see `Trajectory.calls`."""
        return [self._call().given(out=out, t=TIME)]

    def _call(self) -> PartCall:
        return pose_call(self._path, *self._pace)
