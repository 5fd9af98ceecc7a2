"""What is remembered of the efforts sent: the last one, and what holding them did."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.compiled.linalg import copy
from hsp_control.robot import RobotState

_WINDOW = 0.01
"""The acceleration is observed over this time, or over one period if that is longer
[s]: over 1 ms noise of 0.02 rad/s would be 28 rad/s², over 10 ms it is 3."""
_QUICK = 0.03
"""A mean error that a position limit has to hold against is taken over this time [s]:
noise of a velocity is then that over this time, 0.3 rad/s² for 0.01 rad/s."""
_MEMORY = 0.1
"""An error counts less after this time; over it the error that persists is averaged
[s]."""


class Held(NamedTuple):
    """What was seen of the efforts that were held, as kernels read it."""

    # when the period ends, NaN once that was looked at, and its length [s]
    timing: Array
    expected: Array  # velocity that is expected then, shape (nv,) [rad/s or m/s]
    stray: Array  # differences from it, summed over about `_WINDOW`
    error: Array  # largest error of late [rad/s² or m/s²]
    drift: Array  # mean error of late
    quick: Array  # mean error of the last `_QUICK`
    least: Array  # the lowest that mean was of late, 0 or less
    most: Array  # the highest, 0 or more
    lasting: Array  # what that mean and that of the last hundredth of a second share
    # what the mean error and that of the last hundredth of a second have in common: a
    # force that has ended does not count
    steady: Array
    disturbance: Array  # acceleration that something else than the effort causes


class SentEffort:
    """The last effort, and the error of the acceleration while efforts are held.

    The law's acceleration is that of the beginning of a period; while the effort is
    held the robot moves on, and the acceleration changes. The barriers of `Limits` look
    at the beginning of each period, so that a speed limit is exceeded by the error over
    the barrier's bandwidth, unless the margin grows by as much. The error is
    observed: it is the difference between the speed at the end of a period and what was
    expected. So it includes whatever else the model lacks. A position limit is exceeded
    by a mean error over the bandwidth's square. An error of 20 rad/s², as a light wrist
    has it with a load that nobody declared, would be 0.2 rad; the mean follows it in
    `_QUICK`, and its worst is kept for `_MEMORY`, because the next one may be as large.
    """

    def __init__(self, state: RobotState) -> None:
        nv = state.robot.nv
        self._state = state
        self.period = 0.0  # of the last effort [s]; 0: there was none in this run
        # the last effort, and how long it is held [s], inf: not known; shape (nv + 1,)
        self.last = np.zeros(nv + 1)
        self.held = Held(np.zeros(2), *(np.zeros(nv) for _ in range(10)))
        self._acceleration = np.zeros(nv)
        self._expect = state.plan([self.expecting(self._acceleration)]).call()
        self.forget()

    def record(self, tau: Array, acceleration: Array, period: float) -> None:
        """Record an effort, the acceleration it is to give, and how long it is held."""
        self.last[:-1], self.last[-1] = tau, period
        self.record_acceleration(acceleration, period)

    def record_acceleration(self, acceleration: Array, period: float) -> None:
        """Record the acceleration that an effort is to give, and not the effort."""
        self._acceleration[:] = acceleration
        self.held.timing[1] = period
        self._expect()

    def expecting(self, acceleration: Array) -> KernelCall:
        """Return `record_acceleration` of what an array then holds.

        The period is that of the last one.
        """
        state, held = self._state, self.held
        arrays = acceleration, held.disturbance, held.timing, held.expected
        return _expect, (state.time, state.v, *arrays)

    def recording(self) -> KernelCall:
        """Return a call that makes `RobotState.effort` the last effort."""
        return copy, (self._state.effort, self.last[:-1])

    def forget_rate(self) -> None:
        """Forget the last effort: the rate of the next one has no limit."""
        self.last[-1] = np.inf

    def forget(self) -> None:
        """Begin anew."""
        self.period = 0.0
        for each in self.held:
            each[:] = 0.0
        self.held.timing[:] = np.nan
        self.forget_rate()

    def memory(self) -> tuple[Array, ...]:
        """Return a copy of what it remembers."""
        return tuple(each.copy() for each in (self.last, *self.held))

    def remember(self, memory: tuple[Array, ...]) -> None:
        """Set what `memory` returned."""
        for each, value in zip((self.last, *self.held), memory, strict=True):
            each[:] = value


@kernel
def _expect(
    time: Array, v: Array, a: Array, disturbance: Array, timing: Array, expected: Array
) -> None:
    """Write the end of a period that begins now, and the velocity there."""
    timing[0] = time[0] + timing[1]
    for i in range(v.shape[0]):
        expected[i] = v[i] + timing[1] * (a[i] + disturbance[i])


@kernel
def observe(v: Array, held: Held, t: float) -> None:
    """Add a period to the differences of velocity, and update the largest error."""
    timing, expected, stray, error, drift, quick, least, most, lasting, steady, _ = held
    period = timing[1]
    if not abs(t - timing[0]) < 0.01 * period:
        return
    timing[0] = np.nan
    fresh = min(period / _WINDOW, 1.0)
    fading = np.exp(-period / _MEMORY)
    quickly = np.exp(-period / _QUICK)
    for i in range(v.shape[0]):
        gained = v[i] - expected[i]
        drift[i] = fading * drift[i] + (1.0 - fading) * gained / period
        quick[i] = quickly * quick[i] + (1.0 - quickly) * gained / period
        least[i] = min(fading * least[i], quick[i])
        most[i] = max(fading * most[i], quick[i])
        stray[i] = (1.0 - fresh) * stray[i] + gained
        present = stray[i] / max(period, _WINDOW)
        error[i] = max(fading * error[i], abs(present))
        steady[i] = _shared(drift[i], present)
        lasting[i] = _shared(quick[i], present)


@kernel
def _shared(a: float, b: float) -> float:
    """Return what two numbers have in common: the nearer to 0 of one sign, or 0."""
    return max(min(a, b), 0.0) + min(max(a, b), 0.0)
