"""The limits in force: the numbers that every step reads and changes write."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import (
    Barrier,
    MinimumDistance,
    RobotLimits,
    barrier_names,
)
from hsp_control.constraints.limits.acceleration_bounds import (
    Bounds,
    Ends,
    MotionLimits,
)
from hsp_control.control.actuation.sent_effort import SentEffort, SentMemory
from hsp_control.control.evolution import Evolution
from hsp_control.control.planned import PlannedLimits
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.robot import Robot, RobotState


class LimitSet:
    """One set of limits, as calls read it; None: nothing is limited."""

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
        self.rate = False  # whether the effort's rate is limited
        if limits is None:
            return
        self.rate = bool(np.isfinite(limits.effort_rate).any())
        numbers = (np.array(each) for each in limits.motion)
        self.motion = MotionLimits(*numbers)
        self.ends = Ends.of(limits.lower, limits.upper, limits.velocity)
        # writes the bounds on the next effort
        self.updating = PartCall(
            engine.EffortWindow,
            last=sent.last,
            effort=np.array(limits.effort),
            rate=np.array(limits.effort_rate),
            lower=self.bounds.tau_lower,
            upper=self.bounds.tau_upper,
        )
        self.update: Callable[[], object] = state.plan([self.updating]).call()
        self.update()


Measured = list[tuple[str, Callable[[], Array]]]
"""Functions that return the distances of barriers in a step, by their names."""


class LimitsAt(NamedTuple):
    """The limits that `LimitsInForce` follows."""

    all: list[LimitSet]  # the sets that are in force, or will be
    evolutions: list[Evolution[float]]  # the share of each
    shares: Array  # the same now, shape (sets,)
    calls: PartCalls  # those that write them, at a time
    rate: bool  # whether the effort's rate is limited
    bars: bool  # whether there are barriers


class LimitsInForce:
    """The sets of limits in force, and the memory of the efforts sent.

    Its only memory is of the last efforts, used where the effort's rate or the speed is
    limited.

    Attributes:
        all: The sets that are in force, or will be.
        shares: The share of each, in [0, 1], shape (sets,).
        calls: Those that write the shares of a time.
    """

    all: list[LimitSet]
    shares: Array
    calls: PartCalls

    def __init__(
        self, state: RobotState, planned: PlannedLimits, memory: SentMemory
    ) -> None:
        self._state = state
        self.sent = SentEffort(state, memory)
        self._rate = True  # the last effort in the memory limits the next one
        self.all = []
        self._planned: LimitsAt | None = None
        self._measured: dict[tuple[bool, ...], Measured] = {}
        self.plan(planned, -np.inf)

    def plan(self, planned: PlannedLimits, t: float) -> None:
        """Follow other limits from now on; t is the present time [s]."""
        self.go_over_to(self.planned(planned, t))

    def planned(self, planned: PlannedLimits, t: float) -> "LimitsAt":
        """Return the limits in force at a time [s], which may be later."""
        state, known = self._state, {id(each.limits): each for each in self.all}
        sets = [
            known.get(id(limits)) or LimitSet(limits, state, self.sent)
            for limits, _ in planned.sets
        ]
        evolutions = [share for _, share in planned.sets]
        shares = np.array([share.at(t) for share in evolutions])
        calls = [
            share.call(shares[k : k + 1])
            for k, share in enumerate(evolutions)
            if not share.constant
        ]
        rate = any(each.rate for each in sets)
        bars = any(each.limits and each.limits.barriers for each in sets)
        return LimitsAt(sets, evolutions, shares, calls, rate, bars)

    def go_over_to(self, planned: "LimitsAt") -> object:
        """Follow it from now on; return the record that was followed before."""
        before = self._planned, self._measured
        if not self._rate:
            self.sent.forget_rate()
        self._planned, self._measured = planned, {}
        self.all, self._evolutions, self.shares, self.calls, self._rate, self._bars = (
            planned
        )
        return before

    @property
    def sets(self) -> list[tuple[LimitSet, float]]:
        """The sets in force, and the share of each, in (0, 1]."""
        pairs = zip(self.all, self.shares.tolist(), strict=True)
        return [pair for pair in pairs if pair[1] > 0.0]

    def sets_at(self, t: float) -> list[LimitSet]:
        """Return the sets that are in force at a time [s]."""
        pairs = zip(self.all, self._evolutions, strict=True)
        return [each for each, share in pairs if share.at(t) > 0.0]

    @property
    def measured(self) -> Measured:
        """A function that returns the distances of the barriers in force, by name.

        The engine's steps write those of shapes; an own barrier is evaluated again.
        """
        if not self._bars:
            return []
        on = tuple([share > 0.0 for share in self.shares.tolist()])
        if on not in self._measured:
            self._measured[on] = self._measuring([each for each, _ in self.sets])
        return self._measured[on]

    def _measuring(self, sets: Sequence[LimitSet]) -> Measured:
        limits, state = [each.limits for each in sets], self._state
        barriers = [b for each in limits if each is not None for b in each.barriers]
        return [
            (name, _distances(each, state))
            for name, each in zip(barrier_names(barriers), barriers, strict=True)
        ]

    @property
    def limits(self) -> RobotLimits | None:
        """The limits in force, if any; of several sets their mean."""
        sets = [(each.limits, share) for each, share in self.sets]
        return _mean(sets, self._state.robot)

    def applied(self, tau: Array, acceleration: Array, period: float) -> None:
        """Record the effort that is sent now: its rate and the speed are limited."""
        self.sent.memory.period = period
        if not self._limit_anything:
            return
        if self._rate:
            self.sent.record(tau, acceleration, period)
            self.update()
        else:
            self.sent.record_acceleration(acceleration, period)

    def applying(self, acceleration: Array) -> list[Callable[[float], Any]]:
        """Return calls of the time equivalent to `applied` of the effort M a + N.

        The period is that of the last `applied`.
        """
        if not self._limit_anything:
            return []
        calls = [self.sent.expecting(acceleration)]
        if self._rate:
            windows = [each.updating for each in self.all if each.rate]
            calls += [self.sent.recording(), *windows]
        return self._state.plan(calls).steps()

    def applying_all(self, tau: Array, acceleration: Array, period: Array) -> PartCalls:
        """Return the calls equivalent to `applied`, with these arrays as arguments.

        Args:
            tau: Effort, shape (nv,) [N·m or N].
            acceleration: The acceleration that it is to give, shape (nv,).
            period: How long it is held, shape (1,) [s].
        """
        if not self._limit_anything:
            return []
        last, held = self.sent.last, self.sent.held.timing[1:]
        calls = [
            PartCall(engine.Copy, x=period, out=held),
            self.sent.expecting(acceleration),
        ]
        if self._rate:
            calls.append(PartCall(engine.Copy, x=tau, out=last[:-1]))
            calls.append(PartCall(engine.Copy, x=period, out=last[-1:]))
            calls += [each.updating for each in self.all if each.rate]
        return calls

    def update(self) -> None:
        """Compute the range that rate limits leave for the next effort."""
        for each in self.all:
            if each.rate:
                each.update()

    @property
    def _limit_anything(self) -> bool:
        return any(each.limits is not None for each, _ in self.sets)


def _mean(
    sets: Sequence[tuple[RobotLimits | None, float]], robot: Robot
) -> RobotLimits | None:
    """Return the limits that a mixture keeps: the weighted mean of the numbers."""
    # Bounds on efforts and accelerations are weighted means; inf if one of them is.
    # Barriers are those of all sets.
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
    """Return all numbers of limits as one array; those of None are unlimited."""
    if limits is None:
        signs = 1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0
        return np.append(np.repeat(np.inf * np.array(signs), nv), 10.0)
    x = limits
    rows = x.effort, x.effort_rate, x.velocity, x.lower, x.upper, *x.motion
    return np.asarray(np.concatenate(rows))


def _distances(barrier: Barrier, state: RobotState) -> Callable[[], Array]:
    """Return a function for the distances of a barrier at the step's state."""
    if isinstance(barrier, MinimumDistance):
        written = barrier.clearance.proximity(state).distances
        return lambda: written
    return lambda: np.atleast_1d(np.array(barrier.values(state.read_only), dtype=float))
