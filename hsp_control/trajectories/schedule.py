"""Intervals of activity, with smooth ramps."""

from collections.abc import Sequence
from functools import cached_property
from math import inf, nextafter
from typing import Annotated

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field

from hsp_control import engine
from hsp_control.common.errors import ScheduleError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import NonNegative, Number, plain
from hsp_control.engine.plans import implemented_by


def _finite_or_none(value: object) -> object:
    """Return plain lists, with None for a start at -inf and an end at inf."""
    value = plain(value)
    return [*map(_pair, value)] if isinstance(value, list | tuple) else value


def _pair(value: object) -> object:
    value = plain(value)
    if not isinstance(value, list | tuple) or len(value) != 2:
        return value
    start, end = map(plain, value)
    return [None if start == -np.inf else start, None if end == np.inf else end]


Intervals = Annotated[
    Sequence[
        Annotated[
            Sequence[Number | None],
            Field(min_length=2, max_length=2),
            AfterValidator(tuple),
        ]
    ],
    Field(min_length=1),
    BeforeValidator(_finite_or_none),
    AfterValidator(tuple),
]
"""Pairs (start, end) [s], stored as tuples; -inf and inf are stored as None."""


class Schedule(Part, error=ScheduleError):
    """w(t) in [0, 1]: zero outside the intervals, one inside, with smooth ramps.

    The ramps lie inside the intervals: with a ramp the weight is 0 at the start and the
    end of an interval, so that a task with this weight is added and removed without a
    jump.
    """

    intervals: Intervals
    """[start, end] of the intervals, in order of time [s]; None for no start or no
    end."""
    ramp: NonNegative = 0.3
    """Duration of rises and falls, inside the intervals [s]."""

    def __post_init__(self) -> None:
        """Check that intervals are in order and longer than their ramps."""
        previous = -np.inf
        for start, end in self.windows:
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

    @cached_property
    def windows(self) -> tuple[tuple[float, float], ...]:
        """The intervals, with -inf and inf for no start and no end [s]."""
        return tuple(
            (-np.inf if a is None else a, np.inf if b is None else b)
            for a, b in self.intervals
        )

    @classmethod
    def always(cls) -> "Schedule":
        """Return the schedule that is always active."""
        return cls([(None, None)])

    @property
    def constant(self) -> bool:
        """Whether it is always active."""
        return self.windows == ((-np.inf, np.inf),)

    def active(self, t: float) -> bool:
        """Return whether t [s] is in an interval: start ≤ t < end."""
        return any(start <= t < end for start, end in self.windows)

    def edge(self, t: float) -> float:
        """Return a time just before or after the interval around t, inactive there [s].

        The nearer one of the two is returned.
        """
        for start, end in self.windows:
            if start <= t < end:
                before = nextafter(start, -inf)
                return before if t - start < end - t else end
        return t

    def weight(self, t: float) -> float:
        """Return w(t), t in s; with a ramp it is C² in t."""
        for start, end in self.windows:
            if start <= t < end:
                if self.ramp == 0.0:
                    return 1.0
                return _smooth((t - start) / self.ramp) * _smooth((end - t) / self.ramp)
        return 0.0

    def interval(self, t: float) -> tuple[float, float]:
        """Return an interval in (0, 1) of length w(t), t in s, C² in t.

        It grows from 0, and shrinks towards 1, so that it and that of something that
        comes meanwhile fill (0, 1) together.
        """
        if implemented_by(self, "interval", "weight") == "weight":  # in a derived class
            return 0.0, self.weight(t)
        for start, end in self.windows:
            if start <= t < end:
                if self.ramp == 0.0:
                    return 0.0, 1.0
                since_end = (t - end) / self.ramp
                return _smooth(1.0 + since_end), _smooth((t - start) / self.ramp)
        return 0.0, 0.0


def _smooth(s: float) -> float:
    """Return the quintic step 10 s³ - 15 s⁴ + 6 s⁵; 0 for s < 0, 1 for s > 1."""
    if s >= 1.0:
        return 1.0
    return s**3 * (10.0 - 15.0 * s + 6.0 * s * s) if s > 0.0 else 0.0


def smooth_step(
    t: float, start_time: float, duration: float
) -> tuple[float, float, float]:
    """Return s(t) = 10 u³ - 15 u⁴ + 6 u⁵, u = (t - t0) / T, with s' and s''.

    s goes from 0 to 1 with zero velocity and acceleration at both ends; of all such
    motions it has the minimum jerk. It is exactly 0 before and exactly 1 after, hence
    C². The peaks of s' and s'' are 1.875 / T and 5.77 / T².
    """
    return engine.smooth_step(t, start_time, duration)
