"""What holding an effort for a period adds to the acceleration, as it is observed."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind

_WINDOW = 0.01
"""The acceleration is observed over this time, or over one period if that is longer
[s]: over 1 ms noise of 0.02 rad/s would be 28 rad/s², over 10 ms it is 3."""
_MEMORY = 0.1
"""An error counts less after this time; over it the error that persists is averaged
[s]."""


class Held(NamedTuple):
    """The memory of a `HeldEffort`, as kernels read it, shape (nv,) each."""

    # when the period ends, NaN once that was looked at, and its length [s]
    timing: Array
    expected: Array  # velocity that is expected then [rad/s or m/s]
    stray: Array  # differences from it, summed over about `_WINDOW`
    error: Array  # largest error of late [rad/s² or m/s²]
    drift: Array  # mean error of late
    # what the mean error and that of the last hundredth of a second have in common: a
    # force that has ended does not count
    steady: Array
    disturbance: Array  # acceleration that something else than the effort causes


class HeldEffort:
    """The error of the acceleration while an effort is held for a period.

    The law's acceleration is that of the beginning of a period; while the effort is
    held the robot moves on, and the acceleration changes. The barriers of `Limits` look
    at the beginning of each period, so that a speed limit is exceeded by the error over
    the barrier's bandwidth, unless the margin grows by as much. The error is
    observed: it is the difference between the speed at the end of a period and what was
    expected. So it includes whatever else the model lacks. A position limit is exceeded
    by an error only while it lasts: by its mean over the bandwidth's square.
    """

    def __init__(self, nv: int) -> None:
        self.held = Held(np.full(2, np.nan), *(np.zeros(nv) for _ in range(6)))
        self._expect = IdentityCache(self.expect)

    def sent(self, t: float, v: Array, a: Array, period: float) -> None:
        """Record that the effort of an acceleration is held from now on."""
        self.held.timing[1] = period
        self._expect.get(v, a)(t)

    def expect(self, v: Array, a: Array) -> Callable[[float], float]:
        """Return `sent` of what these arrays then hold, as a call of the time."""
        # The period is that of the last `sent`.
        held = self.held
        arrays = v, a, held.disturbance, held.timing, held.expected
        return bind(_expect, *arrays, timed=True)

    def prepare(self, v: Array, a: Array) -> None:
        """Compile what `sent` calls, for these arrays."""
        self._expect.get(v, a)

    def forget(self) -> None:
        """Begin anew."""
        for each in self.held:
            each[:] = 0.0
        self.held.timing[:] = np.nan

    def memory(self) -> tuple[Array, ...]:
        """Return a copy of what it remembers."""
        return tuple(each.copy() for each in self.held)

    def remember(self, memory: tuple[Array, ...]) -> None:
        """Set what `memory` returned."""
        for each, value in zip(self.held, memory, strict=True):
            each[:] = value


@kernel
def _expect(
    v: Array, a: Array, disturbance: Array, timing: Array, expected: Array, t: float
) -> None:
    """Write the end of a period that begins now, and the velocity there."""
    timing[0] = t + timing[1]
    for i in range(v.shape[0]):
        expected[i] = v[i] + timing[1] * (a[i] + disturbance[i])


@kernel
def observe(v: Array, held: Held, t: float) -> None:
    """Add a period to the differences of velocity, and update the largest error."""
    timing, expected, stray, error, drift, steady, _ = held
    period = timing[1]
    if not abs(t - timing[0]) < 0.01 * period:
        return
    timing[0] = np.nan
    fresh = min(period / _WINDOW, 1.0)
    fading = np.exp(-period / _MEMORY)
    for i in range(v.shape[0]):
        gained = v[i] - expected[i]
        drift[i] = fading * drift[i] + (1.0 - fading) * gained / period
        stray[i] = (1.0 - fresh) * stray[i] + gained
        present = stray[i] / max(period, _WINDOW)
        error[i] = max(fading * error[i], abs(present))
        steady[i] = max(min(drift[i], present), 0.0) + min(max(drift[i], present), 0.0)


@kernel
def effort_window(
    sent: Array, effort: Array, rate: Array, lower: Array, upper: Array
) -> None:
    """Write the range of the next effort, where the effort's rate is limited."""
    # Shapes: sent (nv + 1,), see `Actuation`, the others (nv,).
    period = sent[effort.shape[0]]
    for i in range(effort.shape[0]):
        # The last effort may lie outside the limits: then move towards them.
        lower[i] = min(max(sent[i] - rate[i] * period, -effort[i]), effort[i])
        upper[i] = max(min(sent[i] + rate[i] * period, effort[i]), -effort[i])
