"""Time intervals in which something is active, with smooth ramps at their ends."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.exceptions import ScheduleError


class Schedule:
    """w(t) in [0, 1]: zero outside the intervals, one inside, with smooth ramps.

    The ramps lie inside the intervals: with a ramp the weight is 0 at the start and the
    end of an interval, so that a task with this weight is added and removed without a
    jump.

    Attributes:
        intervals: (start, end) of each interval [s].
        ramp: Duration of each rise and each fall [s].
    """

    def __init__(
        self, intervals: Sequence[tuple[float, float]], *, ramp: float = 0.0
    ) -> None:
        """Set the intervals.

        Args:
            intervals: (start, end) of each interval [s], in order of time. The first
                may start at -inf, and the last may end at inf.
            ramp: Duration of each rise and each fall ≥ 0 [s].

        Raises:
            ScheduleError: If an interval does not end after its start, two overlap, an
                interval is shorter than its ramps, or the ramp is negative.
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
                    f"the interval from {start:g} to {end:g} s overlaps the previous "
                    f"one, which ends at {previous:g} s"
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
        """Return the schedule that is always active."""
        return cls([(-np.inf, np.inf)])

    def __repr__(self) -> str:
        return f"Schedule({list(self.intervals)}, ramp={self.ramp:g})"

    @property
    def constant(self) -> bool:
        """Whether it is always active."""
        return self.intervals == ((-np.inf, np.inf),)

    def active(self, t: float) -> bool:
        """Return whether t [s] is in an interval: start ≤ t < end."""
        return any(start <= t < end for start, end in self.intervals)

    def weight(self, t: float) -> float:
        """Return w(t), t in s; with a ramp it is C² in t."""
        for start, end in self.intervals:
            if start <= t < end:
                if self.ramp == 0.0:
                    return 1.0
                return _smooth((t - start) / self.ramp) * _smooth((end - t) / self.ramp)
        return 0.0


def _smooth(s: float) -> float:
    """Return the quintic step 10 s³ - 15 s⁴ + 6 s⁵; 0 for s < 0, 1 for s > 1."""
    if s >= 1.0:
        return 1.0
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s) if s > 0.0 else 0.0
