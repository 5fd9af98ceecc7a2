"""The possible efforts of a robot: those that were sent, or its own at the start."""

import numpy as np

from hsp_control.common.arrays import Array

_ROUNDING, _LARGEST_ROUNDING = 0.01, 1.0
"""Tolerance of an effort beyond the sent ones: a share of the limit, and the maximum
[N·m or N]. Motors have discrete steps."""
_START, _LARGEST_START = 0.1, 10.0
"""The same at the start, after the robot has held itself: its model may have another
load."""
_START_PERIODS = 5
"""Number of periods for which its own effort may last after that."""
_FADES = 0.99
"""Factor by which an excess beyond all sent efforts must decrease every period: a
filter of 1.6 Hz at 1 kHz."""


class SentEfforts:
    """The efforts of the last periods, and whether a given one may be in force.

    It has one of these, or a mean of some if it filters.
    """

    def __init__(self, limits: Array, periods: int) -> None:
        """``limits`` are those of the efforts, shape (nv,), inf where unlimited."""
        self._rounding = np.minimum(_ROUNDING * limits, _LARGEST_ROUNDING)
        self._start = np.minimum(_START * limits, _LARGEST_START)
        self._sent: Array = np.zeros((periods, limits.size))
        self.restart(np.zeros(limits.size))

    def restart(self, effort: Array) -> None:
        """Begin while the robot holds itself, with an effort near this one, (nv,)."""
        self._sent[:] = effort
        self._count = self._answers = 0
        self._above, self._below = np.zeros((2, effort.size))

    def add(self, effort: Array) -> None:
        """Record an effort that is sent, shape (nv,)."""
        self._sent[self._count % len(self._sent)] = effort
        self._count += 1

    def mean(self, periods: int) -> Array:
        """Return the mean of those of the last periods, shape (nv,)."""
        last = np.arange(self._count - periods, self._count) % len(self._sent)
        mean: Array = self._sent[last].mean(axis=0)
        return mean

    def bounds_of(self, effort: Array) -> tuple[Array, Array, Array]:
        """Return its least and greatest possible effort, and the tolerance of rounding.

        Args:
            effort: The effort that the robot reports, shape (nv,).

        Returns:
            Three arrays, shape (nv,).
        """
        sent_least = np.minimum.reduce(self._sent)
        sent_most = np.maximum.reduce(self._sent)
        self._answers += 1
        if self._answers <= _START_PERIODS:
            least, most = np.minimum(sent_least, 0.0), np.maximum(sent_most, 0.0)
            spare = self._start
        else:
            least = sent_least - _FADES * self._below
            most = sent_most + _FADES * self._above
            spare = self._rounding
        # An excess by rounding alone does not accumulate.
        beyond = np.maximum(effort, sent_most) - sent_most
        self._above = np.minimum(beyond, most - sent_most)
        beyond = sent_least - np.minimum(effort, sent_least)
        self._below = np.minimum(beyond, sent_least - least)
        return least, most, spare
