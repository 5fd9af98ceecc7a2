"""The limits in force, and what is remembered of the efforts sent.

The numbers that every step reads, as changes make them; the rate of the efforts, and
what holding them does.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.compiled.linalg import copy
from hsp_control.constraints.limits import RobotLimits
from hsp_control.constraints.limits.acceleration_bounds import Bounds, MotionLimits
from hsp_control.control.evolution import Evolution, PlannedLimits
from hsp_control.robot import Robot, RobotState

_WINDOW = 0.01
"""The acceleration is observed over this time, or over one period if that is longer
[s]: over 1 ms noise of 0.02 rad/s would be 28 rad/s², over 10 ms it is 3."""
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
    by an error only while it lasts: by its mean over the bandwidth's square.
    """

    def __init__(self, state: RobotState) -> None:
        nv = state.robot.nv
        self._state = state
        self.period = 0.0  # of the last effort [s]; 0: there was none in this run
        # the last effort, and how long it is held [s], inf: not known; shape (nv + 1,)
        self.last = np.zeros(nv + 1)
        self.held = Held(np.zeros(2), *(np.zeros(nv) for _ in range(6)))
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
    last: Array, effort: Array, rate: Array, lower: Array, upper: Array
) -> None:
    """Write the range of the next effort, which limits on it and its rate leave."""
    # Shapes: last (nv + 1,), see `SentEffort`, the others (nv,).
    period = last[effort.shape[0]]
    for i in range(effort.shape[0]):
        # The last effort may lie outside the limits: then move towards them.
        lower[i] = min(max(last[i] - rate[i] * period, -effort[i]), effort[i])
        upper[i] = max(min(last[i] + rate[i] * period, effort[i]), -effort[i])


class LimitSet:
    """One set of limits, as kernels read it; None: nothing is limited."""

    def __init__(
        self, limits: RobotLimits | None, state: RobotState, sent: SentEffort
    ) -> None:
        nv = state.robot.nv
        self.limits, self.sent = limits, sent
        # bounds of the next step; those on the effort are always up to date
        self.bounds = Bounds(
            np.full(nv, -np.inf),
            np.full(nv, np.inf),
            np.full(nv, -np.inf),
            np.full(nv, np.inf),
        )
        # whether there are but bounds on accelerations and efforts
        self.box = limits is None or not (limits.barriers or limits.static_effort)
        self.rate = False  # whether the effort's rate is limited
        if limits is None:
            return
        self.rate = bool(np.isfinite(limits.effort_rate).any())
        numbers = (np.array(each) for each in limits.motion)
        self.motion = MotionLimits(*numbers)
        # writes the bounds on the next effort
        most = np.array(limits.effort), np.array(limits.effort_rate)
        window = self.bounds.tau_lower, self.bounds.tau_upper
        self.updating: KernelCall = effort_window, (sent.last, *most, *window)
        self.update: Callable[[], object] = state.plan([self.updating]).call()
        self.update()


class LimitsInForce:
    """The sets of limits that count now, and what is remembered of the efforts sent.

    Its only memory is of the last efforts, used where the effort's rate or the speed is
    limited.
    """

    def __init__(self, state: RobotState, planned: PlannedLimits) -> None:
        self._state = state
        self.sent = SentEffort(state)
        self._rate = False
        self._all: list[tuple[LimitSet, Evolution[float]]] = []
        self.plan(planned, -np.inf)

    def plan(self, planned: PlannedLimits, t: float) -> None:
        """Follow other limits from now on; t is the present time [s]."""
        if not self._rate:
            self.sent.forget_rate()
        state, known = self._state, {id(each.limits): each for each in self.all}
        self._all = [
            (known.get(id(limits)) or LimitSet(limits, state, self.sent), share)
            for limits, share in planned.sets
        ]
        self._rate = any(each.rate for each, _ in self._all)
        self.write(t, always=True)

    def write(self, t: float, *, always: bool = False) -> None:
        """Find the sets that count at a time [s]."""
        if always or len(self._all) > 1:
            shares = [(each, share.at(t)) for each, share in self._all]
            # each set that counts, and its share in (0, 1]
            self.sets = [pair for pair in shares if pair[1] > 0.0]

    @property
    def all(self) -> list[LimitSet]:
        """The sets that count now, or will."""
        return [each for each, _ in self._all]

    @property
    def limits(self) -> RobotLimits | None:
        """The limits in force, if any; of several sets their mean."""
        sets = [(each.limits, share) for each, share in self.sets]
        return _mean(sets, self._state.robot)

    def applied(self, tau: Array, acceleration: Array, period: float) -> None:
        """Record the effort that is sent now: its rate and the speed are limited."""
        self.sent.period = period
        if not self._limit_anything:
            return
        if self._rate:
            self.sent.record(tau, acceleration, period)
            self.update()
        else:
            self.sent.record_acceleration(acceleration, period)

    def applying(self, acceleration: Array) -> list[Callable[[float], Any]]:
        """Return calls of the time that do what `applied` does of the effort M a + N.

        The period is that of the last `applied`.
        """
        if not self._limit_anything:
            return []
        calls = [self.sent.expecting(acceleration)]
        if self._rate:
            windows = [each.updating for each in self.all if each.rate]
            calls += [self.sent.recording(), *windows]
        return self._state.plan(calls).steps()

    def update(self) -> None:
        """Find what the last effort leaves for the next one."""
        for each, _ in self._all:
            if each.rate:
                each.update()

    @property
    def _limit_anything(self) -> bool:
        return any(each.limits is not None for each, _ in self.sets)

    def forget(self) -> None:
        """Forget the last efforts."""
        self.sent.forget()
        self.update()

    def remember(self, memory: tuple[Array, ...]) -> None:
        """Go on from what `SentEffort.memory` returned."""
        self.sent.remember(memory)
        self.update()


def _mean(
    sets: Sequence[tuple[RobotLimits | None, float]], robot: Robot
) -> RobotLimits | None:
    """Return the limits that a mixture keeps: the weighted mean of the numbers."""
    # The bounds on efforts and accelerations are linear in them. Where one of them is
    # inf, so is the mean. Barriers are those of all sets.
    if len(sets) == 1:
        return sets[0][0]
    numbers = np.sum([w * _numbers(each, robot.nv) for each, w in sets], axis=0)
    numbers.flags.writeable = False
    effort, rate, velocity, lower, upper, *motion = numbers[:-1].reshape(-1, robot.nv)
    return RobotLimits(
        robot=robot,
        effort=effort,
        effort_rate=rate,
        velocity=velocity,
        lower=lower,
        upper=upper,
        motion=MotionLimits._make((*motion, numbers[-1:])),
        barriers=tuple(one for each, _ in sets if each for one in each.barriers),
    )


def _numbers(limits: RobotLimits | None, nv: int) -> Array:
    """Return all numbers of limits in a row; None has numbers that bound nothing."""
    if limits is None:
        signs = 1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0
        return np.append(np.repeat(np.inf * np.array(signs), nv), 10.0)
    x = limits
    rows = x.effort, x.effort_rate, x.velocity, x.lower, x.upper, *x.motion
    return np.asarray(np.concatenate(rows))
