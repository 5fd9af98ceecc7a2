"""A body that turns in time, with its angular velocity and acceleration."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.trajectories.following import Follower, follow_by
from hsp_control.trajectories.immutable import Immutable


class OrientationSample(NamedTuple):
    """How a body is turned at one instant, and how it turns there."""

    rotation: Array
    """R(t), body to world, shape (3, 3)."""
    angular_velocity: Array
    """ω(t) in the world frame, R' = [ω]× R, shape (3,) [rad/s]."""
    angular_acceleration: Array
    """ω'(t) in the world frame, shape (3,) [rad/s²]."""

    @classmethod
    def allocate(cls) -> "OrientationSample":
        """Return a sample at the identity, for `OrientationTrajectory.sample`."""
        return cls(np.eye(3), np.zeros(3), np.zeros(3))


class OrientationTrajectory(Immutable, ABC):
    """A body that turns in time; immutable, without memory, defined at every t.

    A motion of finite duration holds its first orientation before it and its last one
    after it.
    """

    __slots__ = ()

    @abstractmethod
    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return the orientation at time t with its two derivatives.

        Args:
            t: Time [s].
            out: Where to write; a new sample by default, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.
        """

    def follow(self, out: OrientationSample) -> Follower:
        """Return a function of time that brings ``out`` up to a time.

        See `Trajectory.follow`.
        """
        return follow_by(self.sample, out)

    def _output(self, out: OrientationSample | None) -> OrientationSample:
        """Return ``out``, or a new sample."""
        return OrientationSample.allocate() if out is None else out
