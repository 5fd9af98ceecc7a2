"""The abstract trajectory of a point in Rⁿ."""

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ShapeError
from hsp_control.trajectories.following import Follower, follow_by
from hsp_control.trajectories.immutable import Immutable


class TrajectorySample(NamedTuple):
    """x(t), x'(t) and x''(t): a trajectory at one time, in its own units."""

    position: Array
    """x(t), shape (n,)."""
    velocity: Array
    """x'(t), shape (n,) [1/s]."""
    acceleration: Array
    """x''(t), shape (n,) [1/s²]."""

    @classmethod
    def allocate(cls, dimension: int) -> "TrajectorySample":
        """Return a sample of zeros with n = ``dimension``, for `Trajectory.sample`."""
        return cls(np.zeros(dimension), np.zeros(dimension), np.zeros(dimension))


class Trajectory(Immutable, ABC):
    """x(t) in Rⁿ with x'(t) and x''(t); immutable, stateless, defined at every t.

    A subclass assigns its parameters in ``__init__``, lists them in ``__slots__`` and
    implements `dimension` and `sample`. The coordinates may have any unit; a task says
    which frame and units it needs. A motion of finite duration rests at its first point
    before the start and at its last point after the end.

    A subclass may override `follow` to make repeated sampling faster. If one kernel
    computes the sample, derive from `Compiled` first, then from `Trajectory`, and
    implement `_kernel` instead of `sample`.
    """

    __slots__ = ()

    @property
    @abstractmethod
    def dimension(self) -> int:
        """The number n of coordinates."""

    @abstractmethod
    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x(t), x'(t) and x''(t), shape (n,) each.

        Start an implementation with ``out = self._output(out)``, write all entries, and
        return ``out``.

        Args:
            t: Time [s].
            out: The sample to write into; None: a new one, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.

        Raises:
            ShapeError: If ``out`` has another dimension.
        """

    def follow(self, out: TrajectorySample) -> Follower:
        """Return a function of time [s] that writes the sample into ``out``.

        It does what `sample` does, faster, for repeated sampling into the same memory.
        After this call nothing else may write into ``out``, because a follower may
        skip entries that do not change.
        """
        return follow_by(self.sample, out)

    def _output(self, out: TrajectorySample | None) -> TrajectorySample:
        """Return ``out``, or a new sample if it is None.

        Raises:
            ShapeError: If ``out`` has another dimension than the trajectory.
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
