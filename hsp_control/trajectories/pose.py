"""The abstract trajectory of a pose, one composed of two, and a constant one."""

from abc import ABC, abstractmethod
from functools import cached_property
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Vector3
from hsp_control.declaration.rotation import Rotation
from hsp_control.trajectories.following import Follower, follow_all, follow_by
from hsp_control.trajectories.hold import Hold, HoldOrientation
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample


class PoseSample(NamedTuple):
    """x, x', x'', R, ω and ω': a pose trajectory at one time, in world axes."""

    position: TrajectorySample
    """The body's origin, of dimension 3 [m, m/s, m/s²]."""
    orientation: OrientationSample
    """Its rotation, angular velocity and angular acceleration."""

    @classmethod
    def allocate(cls) -> "PoseSample":
        """Return a sample at the identity and at rest, for `PoseTrajectory.sample`."""
        memory = np.zeros((8, 3))
        memory[3, 0] = memory[4, 1] = memory[5, 2] = 1.0
        return cls.over(memory)

    @classmethod
    def over(cls, memory: Array) -> "PoseSample":
        """Return a sample whose arrays are views of ``memory``; memory (8, 3)."""
        return cls(
            TrajectorySample(memory[0], memory[1], memory[2]),
            OrientationSample(memory[3:6], memory[6], memory[7]),
        )


class PoseTrajectory(Part, ABC, family="poses", error=TrajectoryError):
    """M(t) = (R(t), x(t)) in SE(3); a value, defined at every t.

    Body to world; x is the body's origin [m], all rates are in world axes. A subclass
    declares its parameters as fields and implements `sample`; it may override `follow`,
    see `Trajectory.follow`. If it can be relative to where the robot starts, it
    overrides `relative` and `anchored`.
    """

    @property
    def relative(self) -> bool:
        """Whether it depends on where the robot starts."""
        return False

    def anchored(self, start: pin.SE3) -> "PoseTrajectory":
        """Return this trajectory for a robot that starts in a pose, body to world."""
        return self

    @abstractmethod
    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t with its first two derivatives.

        Args:
            t: Time [s].
            out: The sample to write into; None: a new one, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.
        """

    def follow(self, out: PoseSample) -> Follower:
        """Return a call that writes ``out`` for a time [s]; see `Trajectory.follow`."""

        def sampler(t: float, own: tuple[Array, ...]) -> tuple[Array, ...]:
            sample = self.sample(t, out)
            return own if sample is out else (*sample.position, *sample.orientation)

        return follow_by(sampler, (*out.position, *out.orientation))


class ComposedPose(PoseTrajectory, type="composed"):
    """M(t) = (R(t), x(t)), with x and R given by one trajectory each."""

    position: Trajectory = Hold()
    """x(t) [m]; held where the robot starts by default."""
    orientation: OrientationTrajectory = HoldOrientation()
    """R(t), body to world; held as the robot starts by default."""

    def __post_init__(self) -> None:
        """Check the dimension of the position."""
        if not self.position.relative and self.position.dimension != 3:
            raise TrajectoryError(
                f"position has dimension {self.position.dimension}; "
                "the origin of a pose needs dimension 3"
            )

    @property
    def relative(self) -> bool:
        """Whether one of them depends on where the robot starts."""
        return self.position.relative or self.orientation.relative

    def anchored(self, start: pin.SE3) -> "ComposedPose":
        """Return both for a robot that starts in a pose; see `PoseTrajectory`."""
        return ComposedPose(
            self.position.anchored(start.translation),
            self.orientation.anchored(start.rotation),
        )

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        if out is None:
            out = PoseSample.allocate()
        self.position.sample(t, out.position)
        self.orientation.sample(t, out.orientation)
        return out

    def follow(self, out: PoseSample) -> Follower:
        """Return a function of time that updates ``out``; see `Trajectory.follow`."""
        return follow_all(
            self.position.follow(out.position), self.orientation.follow(out.orientation)
        )


class HoldPose(PoseTrajectory, type="hold_pose"):
    """M(t) = M0, a constant pose."""

    position: Vector3 | None = None
    """The origin in the world, shape (3,) [m]; where the robot starts by default."""
    rotation: Rotation | None = None
    """The orientation, body to world: roll, pitch and yaw [rad], a quaternion or a
    matrix [-]; that in which the robot starts by default."""

    @property
    def relative(self) -> bool:
        """Whether it depends on where the robot starts."""
        return self.position is None or self.rotation is None

    def anchored(self, start: pin.SE3) -> "HoldPose":
        """Return the pose, where the robot starts if it is not given."""
        return HoldPose(
            start.translation if self.position is None else self.position,
            start.rotation if self.rotation is None else self.rotation,
        )

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose and zero rates; see `PoseTrajectory.sample`."""
        return self._parts.sample(t, out)

    def follow(self, out: PoseSample) -> Follower:
        """Write ``out`` once, and return a follower that does nothing."""
        return self._parts.follow(out)

    @cached_property
    def _parts(self) -> ComposedPose:
        return ComposedPose(Hold(self.position), HoldOrientation(self.rotation))
