"""The abstract trajectory of an orientation in SO(3)."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.trajectories.following import Follower, follow_by
from hsp_control.trajectories.immutable import Immutable


class OrientationSample(NamedTuple):
    """R(t), ω(t) and ω'(t): an orientation trajectory at one time."""

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
    """R(t) in SO(3) with ω(t) and ω'(t); immutable, stateless, defined at every t.

    R is body to world, ω is in world axes. A subclass assigns its parameters in
    ``__init__``, lists them in ``__slots__`` and implements `sample`; it may override
    `follow`, or derive from `Compiled`, as described in `Trajectory`. A motion of
    finite duration rests at its first orientation before the start and at its last
    orientation after the end.
    """

    __slots__ = ()

    @abstractmethod
    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R(t), ω(t) and ω'(t), shapes (3, 3), (3,) and (3,).

        Args:
            t: Time [s].
            out: The sample to write into; None: a new one, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.
        """

    def follow(self, out: OrientationSample) -> Follower:
        """Return a function of time [s] that writes the sample into ``out``.

        See `Trajectory.follow`.
        """
        return follow_by(self.sample, out)

    def _output(self, out: OrientationSample | None) -> OrientationSample:
        """Return ``out``, or a new sample if it is None."""
        return OrientationSample.allocate() if out is None else out
