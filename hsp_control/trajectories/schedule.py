"""When something is on: intervals of time, with smooth ramps at their ends."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.exceptions import ScheduleError


class Schedule:
    """A weight from 0 to 1 over time: on within intervals, smooth at their ends.

    The ramps lie inside the intervals: at an interval's start and end the weight is 0,
    so that whatever it weighs may appear and vanish there without a jump.

    Attributes:
        intervals: (start, end) of each interval [s].
        ramp: How long each rise and each fall takes [s].
    """

    def __init__(
        self, intervals: Sequence[tuple[float, float]], *, ramp: float = 0.0
    ) -> None:
        """Set the intervals; the first may start at -inf, the last end at inf.

        Raises:
            ScheduleError: If an interval does not end after its start, two overlap, or
                the ramps do not fit into one.
        """
        if not 0.0 <= ramp < np.inf:
            raise ScheduleError(f"ramp is {ramp} s; must be at least 0")
        self.intervals = tuple((float(start), float(end)) for start, end in intervals)
        self.ramp = float(ramp)
        previous = -np.inf
        for start, end in self.intervals:
            if not start < end:
                raise ScheduleError(
                    f"the interval from {start:g} to {end:g} s is empty"
                )
            if start < previous:
                raise ScheduleError(
                    f"the interval from {start:g} to {end:g} s begins before the one "
                    f"before it ends, at {previous:g} s"
                )
            ramps = self.ramp * ((start > -np.inf) + (end < np.inf))
            if end - start < ramps:
                raise ScheduleError(
                    f"the interval from {start:g} to {end:g} s is shorter than its "
                    f"ramps, {ramps:g} s"
                )
            previous = end

    @classmethod
    def always(cls) -> "Schedule":
        """Return the schedule of what is on at all times."""
        return cls([(-np.inf, np.inf)])

    def __repr__(self) -> str:
        return f"Schedule({list(self.intervals)}, ramp={self.ramp:g})"

    @property
    def constant(self) -> bool:
        """Whether it is on at all times."""
        return self.intervals == ((-np.inf, np.inf),)

    def active(self, t: float) -> bool:
        """Return whether time t [s] lies in an interval; at its start, not its end."""
        return any(start <= t < end for start, end in self.intervals)

    def weight(self, t: float) -> float:
        """Return the weight at time t [s], twice continuously differentiable in t."""
        for start, end in self.intervals:
            if start <= t < end:
                if self.ramp == 0.0:
                    return 1.0
                return _smooth((t - start) / self.ramp) * _smooth((end - t) / self.ramp)
        return 0.0


def _smooth(s: float) -> float:
    """Return the step of quintic shape: 0 below 0, 1 above 1."""
    if s >= 1.0:
        return 1.0
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s) if s > 0.0 else 0.0
