"""A body that moves and turns in time."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError
from hsp_control.trajectories.following import Follower, follow_all, follow_by
from hsp_control.trajectories.immutable import Immutable
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample


class PoseSample(NamedTuple):
    """Where a body is at one instant, and how it moves there, in the world frame."""

    position: TrajectorySample
    """The body's origin, of dimension 3 [m, m/s, m/s²]."""
    orientation: OrientationSample
    """Its rotation, angular velocity and angular acceleration."""

    @classmethod
    def allocate(cls) -> "PoseSample":
        """Return a sample at the identity, to be written into."""
        memory = np.zeros((8, 3))
        memory[3, 0] = memory[4, 1] = memory[5, 2] = 1.0
        return cls.over(memory)

    @classmethod
    def over(cls, memory: Array) -> "PoseSample":
        """Return a sample that is one array of shape (8, 3): x, x', x'', R, ω, ω'."""
        return cls(
            TrajectorySample(memory[0], memory[1], memory[2]),
            OrientationSample(memory[3:6], memory[6], memory[7]),
        )


class PoseTrajectory(Immutable, ABC):
    """A body that moves and turns in time; immutable, defined at every t."""

    __slots__ = ()

    @abstractmethod
    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t with its two derivatives.

        Args:
            t: Time [s].
            out: Where to write; a new sample by default, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.
        """

    def follow(self, out: PoseSample) -> Follower:
        """Return a function of time that brings ``out`` up to a time.

        See `Trajectory.follow`.
        """

        def sampler(t: float, own: tuple[Array, ...]) -> tuple[Array, ...]:
            sample = self.sample(t, out)
            return own if sample is out else (*sample.position, *sample.orientation)

        return follow_by(sampler, (*out.position, *out.orientation))


class ComposedPose(PoseTrajectory):
    """A pose whose origin and orientation follow a trajectory each.

    Attributes:
        position: The origin's trajectory, of dimension 3 [m].
        orientation: The orientation's trajectory.
    """

    __slots__ = ("orientation", "position")

    def __init__(
        self, position: Trajectory, orientation: OrientationTrajectory
    ) -> None:
        """Join the two.

        Raises:
            TrajectoryError: If ``position`` is not a trajectory in space.
        """
        if position.dimension != 3:
            raise TrajectoryError(
                f"position has dimension {position.dimension}; "
                "the origin of a pose moves in dimension 3"
            )
        self.position = position
        self.orientation = orientation

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        if out is None:
            out = PoseSample.allocate()
        self.position.sample(t, out.position)
        self.orientation.sample(t, out.orientation)
        return out

    def follow(self, out: PoseSample) -> Follower:
        """Return a function of time that brings ``out`` up to a time."""
        return follow_all(
            self.position.follow(out.position),
            self.orientation.follow(out.orientation),
        )
