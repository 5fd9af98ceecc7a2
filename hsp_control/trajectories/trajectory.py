"""A point of Rⁿ that moves in time, with its velocity and acceleration."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ShapeError
from hsp_control.trajectories.following import Follower, follow_by
from hsp_control.trajectories.immutable import Immutable


class TrajectorySample(NamedTuple):
    """Where a trajectory is at one instant, and how it moves there."""

    position: Array
    """x(t), shape (n,)."""
    velocity: Array
    """x'(t), shape (n,) [1/s]."""
    acceleration: Array
    """x''(t), shape (n,) [1/s²]."""

    @classmethod
    def allocate(cls, dimension: int) -> "TrajectorySample":
        """Return a sample of zeros, to be written into by `Trajectory.sample`."""
        return cls(np.zeros(dimension), np.zeros(dimension), np.zeros(dimension))


class Trajectory(Immutable, ABC):
    """A point of Rⁿ that moves in time; immutable, without memory, defined at every t.

    To write a new one: bind its parameters in ``__init__``, name them in ``__slots__``,
    and give `dimension` and `sample`. A motion of finite duration holds its first point
    before it and its last point after it.
    """

    __slots__ = ()

    @property
    @abstractmethod
    def dimension(self) -> int:
        """The number n of coordinates."""

    @abstractmethod
    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return the point at time t with its two derivatives.

        Args:
            t: Time [s].
            out: Where to write; a new sample by default, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.
        """

    def follow(self, out: TrajectorySample) -> Follower:
        """Return a function of time that brings ``out`` up to a time, as `sample` does.

        For those who sample again and again: what does not change is decided here.
        From now on nobody else may write into ``out``.
        """
        return follow_by(self.sample, out)

    def _output(self, out: TrajectorySample | None) -> TrajectorySample:
        """Return ``out`` if it fits, or a new sample.

        Raises:
            ShapeError: If ``out`` has not the trajectory's dimension.
        """
        n = self.dimension
        if out is None:
            return TrajectorySample.allocate(n)
        if len(out.position) != n:
            raise ShapeError(
                f"out has dimension {len(out.position)}; "
                f"this {type(self).__name__} has dimension {n}"
            )
        return out
