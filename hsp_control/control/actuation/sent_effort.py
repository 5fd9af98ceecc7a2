"""Memory of the sent efforts: the last one, and the effects of holding them."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.engine.plans import PartCall
from hsp_control.robot import RobotState


class Held(NamedTuple):
    """Observed effects of held efforts, as calls read them."""

    # end of the period, NaN once it was processed, and its length [s]
    timing: Array
    expected: Array  # velocity expected then, shape (nv,) [rad/s or m/s]
    stray: Array  # prediction errors, summed over about 10 ms
    error: Array  # largest recent error [rad/s² or m/s²]
    drift: Array  # recent mean error
    quick: Array  # mean error of the last 30 ms
    least: Array  # recent minimum of that mean, at most 0
    most: Array  # recent maximum, at least 0
    lasting: Array  # common part of it and the mean of the last hundredth of a second
    # common part of the mean error and that of the last hundredth of a second: a
    # force that has ended is not included
    steady: Array
    disturbance: Array  # acceleration with causes other than the effort


@dataclass
class SentMemory:
    """Memory of the sent efforts; calls read and write the arrays."""

    # the last effort, and the time for which it is held [s], inf: unknown; (nv + 1,)
    last: Array
    held: Held
    period: float = 0.0  # of the last effort [s]; 0: there was none in this run

    @classmethod
    def of(cls, nv: int) -> "SentMemory":
        """Return the memory before any effort was sent."""
        held = Held(np.zeros(2), *(np.zeros(nv) for _ in range(10)))
        memory = cls(np.zeros(nv + 1), held)
        memory.clear()
        return memory

    def clear(self) -> None:
        """Begin anew."""
        self.period = 0.0
        for each in (self.last, *self.held):
            each[:] = 0.0
        self.held.timing[0] = self.last[-1] = np.inf

    def become(self, other: "SentMemory") -> None:
        """Copy the values of another memory."""
        self.period = other.period
        given = other.last, *other.held
        for each, number in zip((self.last, *self.held), given, strict=True):
            each[:] = number


class SentEffort:
    """The last effort, and the error of the acceleration while efforts are held.

    The law's acceleration is that of the beginning of a period; while the effort is
    held the robot moves on, and the acceleration changes. The barriers of `Limits` look
    at the beginning of each period, so that a speed limit is exceeded by the error over
    the barrier's bandwidth, unless the margin grows by as much. The error is
    observed: it is the difference between the speed at the end of a period and the
    expected one. So it includes all model errors. A position limit is exceeded
    by a mean error over the bandwidth's square. An error of 20 rad/s², as a light wrist
    has it with an undeclared load, would be 0.2 rad; the mean follows it in
    30 ms, and its worst is kept for 0.1 s, because the next one may be as large.
    """

    def __init__(self, state: RobotState, memory: SentMemory) -> None:
        self._state, self.memory = state, memory
        self.last, self.held = memory.last, memory.held
        self._acceleration = np.zeros(state.robot.nv)
        self._expect = state.plan([self.expecting(self._acceleration)]).call()

    def record(self, tau: Array, acceleration: Array, period: float) -> None:
        """Record an effort, its intended acceleration, and its duration."""
        self.last[:-1], self.last[-1] = tau, period
        self.record_acceleration(acceleration, period)

    def record_acceleration(self, acceleration: Array, period: float) -> None:
        """Record the intended acceleration of an effort, not the effort."""
        self._acceleration[:] = acceleration
        self.held.timing[1] = period
        self._expect()

    def expecting(self, acceleration: Array) -> PartCall:
        """Return `record_acceleration` of the contents of an array.

        The period is that of the last one.
        """
        state, held = self._state, self.held
        return PartCall(
            engine.ExpectedVelocity,
            time=state.time,
            v=state.v,
            a=acceleration,
            disturbance=held.disturbance,
            timing=held.timing,
            expected=held.expected,
        )

    def recording(self) -> PartCall:
        """Return a call that makes `RobotState.effort` the last effort."""
        return PartCall(engine.Copy, x=self._state.effort, out=self.last[:-1])

    def forget_rate(self) -> None:
        """Forget the last effort: the rate of the next one has no limit."""
        self.last[-1] = np.inf
