"""Paths at a speed: another motion's path, at a speed along it."""

from dataclasses import KW_ONLY, replace
from functools import cached_property
from typing import Any, NamedTuple, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError
from hsp_control.declaration.quantities import Number, Positive, Vector
from hsp_control.engine import Plan
from hsp_control.engine.plans import TIME, PartCall, PartCalls, planned
from hsp_control.trajectories import checks
from hsp_control.trajectories.arc_length import (
    ArcLength,
    Course,
    Rates,
    TimeScaling,
    measured,
    time_scaling,
)
from hsp_control.trajectories.orientation import OrientationTrajectory
from hsp_control.trajectories.pose import PoseSample, PoseTrajectory
from hsp_control.trajectories.trajectory import Trajectory

POINTS = 64  # number of points at which a pose's origin is tested for being constant
STAYS = 1e-9  # length of a path [m] below which the origin of a pose is constant


class Pace(NamedTuple):
    """The timing of a path: two arguments of its call."""

    arc: ArcLength
    scaling: TimeScaling


def own_motion(path: Any) -> tuple[Any, Plan]:
    """Return a path's sample, and the plan that writes it at the path's own time."""
    sample, calls = path.supplied()
    return sample, Plan(planned(calls).steps())


def pace(rates: Rates, course: Course, part: Any) -> Pace:
    """Return the timing of a part with speed, acceleration and start_time."""
    path = measured(rates, course)
    scaling = time_scaling(path, part.speed, part.acceleration, part.start_time)
    return Pace(path.arc, scaling)


def point_rates(path: Trajectory) -> Rates:
    """Return the rates from which a length is computed: dp/du and its rate."""
    own, plan = own_motion(path)

    def rates(u: float) -> tuple[Array, Array]:
        plan(u)
        return own.velocity.copy(), own.acceleration.copy()

    return rates


def angle_rates(path: OrientationTrajectory) -> Rates:
    """Return the rates from which an angle is computed: ω and its rate, by u."""
    own, plan = own_motion(path)

    def rates(u: float) -> tuple[Array, Array]:
        plan(u)
        return own.angular_velocity.copy(), own.angular_acceleration.copy()

    return rates


def pose_pace(path: PoseTrajectory, course: Course, part: Any) -> tuple[Pace, bool]:
    """Return the timing of poses, and whether their length is the angle."""
    own, plan = own_motion(path)
    position, orientation = own

    def moving(u: float) -> tuple[Array, Array]:
        plan(u)
        return position.velocity.copy(), position.acceleration.copy()

    def turning(u: float) -> tuple[Array, Array]:
        plan(u)
        _, omega, omega_dot = orientation
        return omega.copy(), omega_dot.copy()

    first, last = course.knots[0], course.knots[-1]
    speeds = [np.linalg.norm(moving(u)[0]) for u in np.linspace(first, last, POINTS)]
    by_angle = bool(max(speeds) * (last - first) < STAYS)
    return pace(turning if by_angle else moving, course, part), by_angle


def point_call(path: Trajectory, pace: Pace) -> PartCall:
    """Return the call that follows points."""
    own, plan = own_motion(path)
    return PartCall(engine.Along, path=plan, own=own, **pace._asdict())


def pose_call(path: PoseTrajectory, pace: Pace, by_angle: bool) -> PartCall:
    """Return the call that follows poses."""
    own, plan = own_motion(path)
    return PartCall(
        engine.AlongPose, path=plan, own=own, by_angle=by_angle, **pace._asdict()
    )


def followed(path: Any, interval: ArrayLike | None) -> Course:
    """Return the times between which a path is followed."""
    course: Course | None = path.course
    if interval is None:
        if course is None:
            raise TrajectoryError(
                f"where a path of {type(path).__name__} begins and ends is not known: "
                "give interval, its own first and last time [s]"
            )
        return course
    first, last = checks.array(interval, "interval", (2,))
    if not first < last:
        raise TrajectoryError(f"interval must increase; it is [{first:g}, {last:g}]")
    if course is None or course.repeats:
        return Course(np.array([first, last]), False)
    knots = course.knots
    if first < knots[0] or last > knots[-1]:
        raise TrajectoryError(
            f"the path goes from {knots[0]:g} to {knots[-1]:g} s; "
            f"interval is [{first:g}, {last:g}]"
        )
    inner = knots[(knots > first) & (knots < last)]
    return Course(np.array([first, *inner, last]), False)


class Along(Trajectory, type="along"):
    """x(t) = p(s(t)): the path of any motion, at a speed along it, s its length.

    x' = p' s' and x'' = p' s'' + p'' s'², with p' and p'' by s. The path's own times
    define only its shape, not its speed.

    With an acceleration the motion goes from rest to rest, and is C² where the path is:
    the speed is a trapezoid with cubic ramps. x'' is fed forward: at the corners of a
    plain trapezoid it would jump, and efforts with it. A ramp takes 1.5 v/a instead of
    v/a; on a short path the speed is not reached.

    Without an acceleration the speed is constant. Where the path begins and ends x'
    then jumps, unless it goes on for ever, as a circle does: blend into it.

    Raises:
        TrajectoryError: At a corner, which can only be passed at rest, or where the
        path bends so much that v²/r is more than the acceleration. The message gives
        the place, and a feasible speed.

    References:
        B. Siciliano, L. Sciavicco, L. Villani, G. Oriolo, "Robotics: Modelling,
        Planning and Control", Springer, 2009, section 4.3.
    """

    path: Trajectory
    """p. Only the order of its times is used, and for a spline its shape; of a circle's
    rate only the sense."""
    speed: Positive
    """Largest speed v along the path [m/s, or the task's unit per s]."""
    acceleration: Positive | None = None
    """Largest acceleration a along the path, and across it in bends [m/s², or the
    task's unit per s²]; constant speed by default."""
    _: KW_ONLY
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""
    interval: Vector | None = None
    """The path's own first and last time, shape (2,) [s]; all of it by default."""

    def __post_init__(self) -> None:
        """Measure the path, which checks it."""
        if not self.relative:
            self._pace  # noqa: B018 (computed, checked and kept)

    @property
    def relative(self) -> bool:
        """Whether the path depends on the robot's start."""
        return self.path.relative or super().relative

    def anchored(self, start: ArrayLike | None) -> Trajectory:
        """Return the path in the world; see `Trajectory.anchored`."""
        if self.origin == "start":
            return super().anchored(start)  # raises: the path has an origin
        return replace(self, path=self.path.anchored(start)) if self.relative else self

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self.path.dimension

    @property
    def course(self) -> Course | None:
        """From its start to its end."""
        return course_of(self._pace)

    @cached_property
    def _pace(self) -> Pace:
        course = followed(self.path, self.interval)
        return pace(point_rates(self.path), course, self)

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        return point_call(self.path, self._pace)


def course_of(pace: Pace) -> Course | None:
    """Return the times between which a path is followed; None: forever."""
    start_time, speed, ramp, length = pace.scaling
    if pace.arc.repeats:
        return None
    end = start_time + ramp + length / speed
    return Course(np.array([start_time, end]), False)


class AlongOrientation(OrientationTrajectory, type="along"):
    """R(t) = P(s(t)): the orientations of any motion, at an angular speed.

    s is the angle through which the body has rotated; everything else is as in `Along`.
    """

    path: OrientationTrajectory
    """P. Only the order of its times is used, and of a spin's rate the sense."""
    speed: Positive
    """Largest angular speed |ω| [rad/s]."""
    acceleration: Positive | None = None
    """Largest angular acceleration, about the axis and of it [rad/s²]; constant speed
    by default."""
    _: KW_ONLY
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""
    interval: Vector | None = None
    """The path's own first and last time, shape (2,) [s]; all of it by default."""

    def __post_init__(self) -> None:
        """Measure the path, which checks it."""
        if not self.relative:
            self._pace  # noqa: B018 (computed, checked and kept)

    @property
    def relative(self) -> bool:
        """Whether the path depends on the robot's start."""
        return self.path.relative

    def anchored(self, start: ArrayLike) -> Self:
        """Return the path from the start orientation; see `OrientationTrajectory`."""
        return replace(self, path=self.path.anchored(start)) if self.relative else self

    @property
    def course(self) -> Course | None:
        """From its start to its end."""
        return course_of(self._pace)

    @cached_property
    def _pace(self) -> Pace:
        course = followed(self.path, self.interval)
        return pace(angle_rates(self.path), course, self)

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        own, plan = own_motion(self.path)
        return PartCall(
            engine.AlongOrientation, path=plan, own=own, **self._pace._asdict()
        )


class AlongPose(PoseTrajectory, type="along_pose"):
    """M(t) = P(s(t)): the poses of any motion, at a speed of its origin.

    s is the length of the origin's path, and the rotation is synchronous with it. If
    the origin is constant, s is the angle through which the body rotates, speed is in
    rad/s, and acceleration in rad/s². Everything else is as in `Along`.
    """

    path: PoseTrajectory
    """P. Only the order of its times is used; its position and its orientation stay
    synchronous."""
    speed: Positive
    """Largest speed v of the origin [m/s, or rad/s]."""
    acceleration: Positive | None = None
    """Largest acceleration a of the origin along its path, and across it in bends
    [m/s², or rad/s²]; constant speed by default."""
    _: KW_ONLY
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""
    interval: Vector | None = None
    """The path's own first and last time, shape (2,) [s]; all of it by default."""

    def __post_init__(self) -> None:
        """Measure the path, which checks it."""
        if not self.relative:
            self._pace  # noqa: B018 (computed, checked and kept)

    @property
    def relative(self) -> bool:
        """Whether the path depends on the robot's start."""
        return self.path.relative

    def anchored(self, start: pin.SE3) -> "AlongPose":
        """Return the path from a start pose; see `PoseTrajectory.anchored`."""
        return replace(self, path=self.path.anchored(start)) if self.relative else self

    @property
    def course(self) -> Course | None:
        """From its start to its end."""
        return course_of(self._pace[0])

    @cached_property
    def _pace(self) -> tuple[Pace, bool]:
        """The timing of the path, and whether its length is the angle."""
        return pose_pace(self.path, followed(self.path, self.interval), self)

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        out = self._output(out)
        engine.AlongPose(**self._call().arguments, out=out)(float(t))
        return out

    def calls(self, out: PoseSample) -> PartCalls:
        """Return the call that writes ``out``; see `Trajectory.calls`."""
        return [self._call().given(out=out, t=TIME)]

    def _call(self) -> PartCall:
        return pose_call(self.path, *self._pace)
