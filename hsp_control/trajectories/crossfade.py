"""A smooth change from one reference to another, both of which may move."""

from dataclasses import KW_ONLY, replace
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError
from hsp_control.declaration.nested import parts_within, with_parts_replaced
from hsp_control.declaration.quantities import NonNegative, Number
from hsp_control.engine import Plan
from hsp_control.engine.plans import TIME, PartCall, PartCalls, planned
from hsp_control.trajectories.blend import offset_coefficients
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.pose import ComposedPose, PoseTrajectory
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample

AnyReference = Trajectory | OrientationTrajectory | PoseTrajectory

MOST_OVERLAPPING = 64
"""Maximum number of changes of one reference that overlap: the next one then needs 40
ms, and a nesting of a few hundred parts exceeds Python's limit."""


class Crossfade(Trajectory, type="crossfade"):
    """x(t) = (1 - s) x_0(t) + s x_1(t), with s the `smooth_step`; C² if both are."""

    before: Trajectory
    """x_0, until the change."""
    after: Trajectory
    """x_1, from the end of the change on."""
    _: KW_ONLY
    start_time: Number = 0.0
    """Time at which the change begins [s]."""
    duration: NonNegative = 0.3
    """Duration of the change [s]; 0 is a jump."""

    def __post_init__(self) -> None:
        """Check that both have one dimension, and how many changes overlap."""
        _check_overlapping(self)
        if self.relative:
            return
        if self.before.dimension != self.after.dimension:
            raise TrajectoryError(
                f"before has dimension {self.before.dimension}, after has "
                f"{self.after.dimension}; they must be the same"
            )

    @property
    def relative(self) -> bool:
        """Whether one of them depends on the robot's start."""
        return self.before.relative or self.after.relative

    def anchored(self, start: ArrayLike | None) -> "Crossfade":
        """Return both in the world; see `Trajectory.anchored`."""
        return Crossfade(
            self.before.anchored(start),
            self.after.anchored(start),
            start_time=self.start_time,
            duration=self.duration,
        )

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self.after.dimension

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        return PartCall(
            engine.Crossfade,
            start_time=self.start_time,
            duration=self.duration,
            before=self.before,
            after=self.after,
        )

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return the point at time t; see `Trajectory.sample`."""
        if t >= self.start_time + self.duration:  # a stream may have dropped x_0
            return self.after.sample(t, self._output(out))
        return super().sample(t, out)

    def calls(self, out: TrajectorySample) -> PartCalls:
        """Return the calls that write ``out``; see `Trajectory.calls`."""
        if not _streams(self):
            return super().calls(out)
        return [PartCall(engine.CrossfadeOfStreams, **_mixed(self, out), t=TIME)]


class CrossfadeOrientation(OrientationTrajectory, type="crossfade"):
    """R_0(t) until the change, then a `BlendOrientation` into R_1(t); C² if both are.

    The blend begins with orientation, angular velocity and angular acceleration of R_0.
    """

    before: OrientationTrajectory
    """R_0, until the change."""
    after: OrientationTrajectory
    """R_1, from the end of the change on."""
    _: KW_ONLY
    start_time: Number = 0.0
    """Time at which the change begins [s]."""
    duration: NonNegative = 0.3
    """Duration of the change [s]; 0 is a jump."""

    def __post_init__(self) -> None:
        """Check the number of overlapping changes."""
        _check_overlapping(self)

    @property
    def relative(self) -> bool:
        """Whether one of them depends on the robot's start."""
        return self.before.relative or self.after.relative

    def anchored(self, start: ArrayLike) -> "CrossfadeOrientation":
        """Return both with the start orientation; see `OrientationTrajectory`."""
        return CrossfadeOrientation(
            self.before.anchored(start),
            self.after.anchored(start),
            start_time=self.start_time,
            duration=self.duration,
        )

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        return PartCall(
            engine.CrossfadeOrientation,
            start_time=self.start_time,
            duration=self.duration,
            before=self.before,
            coefficients=self._coefficients,
            after=self.after,
        )

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return the orientation at time t; see `OrientationTrajectory.sample`."""
        out = self._output(out)
        end = self.start_time + self.duration
        if t >= end:  # a stream may have dropped R_0
            return self.after.sample(t, out)
        if self._follows_streams:  # for copies, which have another blend
            self.keep_start(end)
        if t < self.start_time:
            return self.before.sample(t, out)
        return super().sample(t, out)

    def calls(self, out: OrientationSample) -> PartCalls:
        """Return the calls that write ``out``; see `Trajectory.calls`."""
        if not self._follows_streams:
            return super().calls(out)
        self.keep_start(self.start_time + self.duration)
        given = {
            **_mixed(self, out),
            "coefficients": np.zeros((6, 3)),
            "found": np.zeros(1, dtype=np.int64),
        }
        return [PartCall(engine.CrossfadeOrientationOfStreams, **given, t=TIME)]

    def keep_start(self, until: float) -> None:
        """Let streams keep the state at the start of the change until a time."""
        for stream in _streams(self):
            stream.run.keep(self.start_time, until)
        for earlier in parts_within(self.before, CrossfadeOrientation):
            earlier.keep_start(until)

    @cached_property
    def _follows_streams(self) -> bool:
        return bool(_streams(self))

    @cached_property
    def _coefficients(self) -> Array:
        """The coefficients of y, which begins with R_0's derivatives; shape (6, 3)."""
        if self.duration == 0.0:
            return np.zeros((6, 3))
        start = self.before.sample(self.start_time)
        return offset_coefficients(
            start, self.after.sample(self.start_time), self.duration
        )


class PositionOf(Trajectory):
    """The origin of a pose trajectory."""

    pose: PoseTrajectory
    """The pose trajectory [m, rad]."""

    @property
    def dimension(self) -> int:
        """Three."""
        return 3

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return the origin at time t; see `Trajectory.sample`."""
        out = self._output(out)
        for own, other in zip(out, self.pose.sample(t).position, strict=True):
            own[:] = other
        return out

    def calls(self, out: TrajectorySample) -> PartCalls:
        """Return the calls that write ``out``; see `Trajectory.calls`."""
        pose, calls = self.pose.supplied()
        return _copied(calls, pose.position, out)


class OrientationOf(OrientationTrajectory):
    """The orientation of a pose trajectory."""

    pose: PoseTrajectory
    """The pose trajectory [m, rad]."""

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return the orientation at time t; see `OrientationTrajectory.sample`."""
        out = self._output(out)
        for own, other in zip(out, self.pose.sample(t).orientation, strict=True):
            own[:] = other
        return out

    def calls(self, out: OrientationSample) -> PartCalls:
        """Return the calls that write ``out``; see `Trajectory.calls`."""
        pose, calls = self.pose.supplied()
        return _copied(calls, pose.orientation, out)


def _copied(calls: PartCalls, sample: Any, out: Any) -> PartCalls:
    """Return calls that write a sample, and then those that copy it."""
    for own, other in zip(out, sample, strict=True):
        own[:] = other  # once, if it is constant
    if not calls:
        return calls
    copies = [
        PartCall(engine.Copy, x=other.ravel(), out=own.ravel(), t=TIME)
        for own, other in zip(out, sample, strict=True)
    ]
    return [*calls, *copies]


def _check_overlapping(part: Crossfade | CrossfadeOrientation) -> None:
    """Check that not too many changes of one reference overlap."""
    count: int = 1
    before: Any = part
    while isinstance(before := before.before, Crossfade | CrossfadeOrientation):
        count += 1
    if count > MOST_OVERLAPPING:
        raise TrajectoryError(
            f"{count} changes of one reference overlap; at most {MOST_OVERLAPPING}. "
            "For frequent changes use a stream, such as set_target(task, target)"
        )


def _streams(part: Crossfade | CrossfadeOrientation) -> tuple[FollowedStream, ...]:
    """Return the streams that follow a change, or that it leads away from."""
    return tuple(parts_within(part, FollowedStream))


def _mixed(part: Crossfade | CrossfadeOrientation, out: Any) -> dict[str, Any]:
    """Return the arguments of a change of streams: both are plans."""
    before: Any = part.before
    after: Any = part.after
    (sample_before, calls_before), (sample_after, calls_after) = (
        before.supplied(),
        after.supplied(),
    )
    return {
        "start_time": part.start_time,
        "duration": part.duration,
        "compute_before": Plan(planned(calls_before).steps()),
        "compute_after": Plan(planned(calls_after).steps()),
        "before": sample_before,
        "after": sample_after,
        "out": out,
    }


def crossfade(
    before: AnyReference, after: AnyReference, *, start_time: float, duration: float
) -> AnyReference:
    """Return the smooth change from one reference to another of the same kind."""
    t0, T = start_time, duration
    if isinstance(before, Trajectory) and isinstance(after, Trajectory):
        return Crossfade(before, after, start_time=t0, duration=T)
    if isinstance(before, OrientationTrajectory) and isinstance(
        after, OrientationTrajectory
    ):
        return CrossfadeOrientation(before, after, start_time=t0, duration=T)
    if isinstance(before, PoseTrajectory) and isinstance(after, PoseTrajectory):
        old, new = _parts(before), _parts(after)
        return ComposedPose(
            Crossfade(old.position, new.position, start_time=t0, duration=T),
            CrossfadeOrientation(
                old.orientation, new.orientation, start_time=t0, duration=T
            ),
        )
    raise TrajectoryError(
        f"{type(before).__name__} cannot change into {type(after).__name__}: one is a "
        "point, an orientation or a pose, and the other is not"
    )


Kind = TypeVar("Kind")


def settled(part: Kind, t: float) -> Kind:
    """Return a part, or several, for times from t [s] on, without completed changes.

    A reference after its change is then the new one, so that nothing accumulates.
    """
    kinds: Any = (Crossfade, CrossfadeOrientation, ComposedPose)
    found: Kind = with_parts_replaced(part, kinds, lambda each: _settled(each, t))
    return found


def _settled(part: Crossfade | CrossfadeOrientation | ComposedPose, t: float) -> Any:
    fields: dict[str, Any] = part.all_fields()
    if isinstance(part, ComposedPose):
        x, R = _last(part.position, t), _last(part.orientation, t)
        of_pose = isinstance(x, PositionOf) and isinstance(R, OrientationOf)
        if of_pose and x.pose is R.pose:
            return settled(x.pose, t)
    elif (last := _last(part, t)) is not part:
        return settled(last, t)
    changed = {name: settled(each, t) for name, each in fields.items()}
    same = all(changed[name] is each for name, each in fields.items())
    return part if same else replace(part, **changed)


def _last(reference: Any, t: float) -> Any:
    """Return the final reference of a change, if it is complete at a time."""
    while isinstance(reference, Crossfade | CrossfadeOrientation):
        if reference.start_time + reference.duration > t:
            break
        reference = reference.after
    return reference


def _parts(pose: PoseTrajectory) -> ComposedPose:
    if isinstance(pose, ComposedPose):
        return pose
    return ComposedPose(PositionOf(pose), OrientationOf(pose))
