"""A stream in one run: messages become waypoints, and a reference, piece by piece.

Whenever a message arrives, the rest of the reference is planned again, from what it
*is* (x, x', x'') and not from what was planned. A piece, once begun, never changes; so
the reference is a C² function of time, whatever arrives and however often it is asked.
"""

from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import Sequence
from copy import copy, deepcopy
from itertools import groupby
from math import inf
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.inbox import Reader
from hsp_control.trajectories.streams.message import Message
from hsp_control.trajectories.streams.segments import (
    SAME,
    Goal,
    Joiner,
    MotionBounds,
    Segment,
    coast,
)
from hsp_control.trajectories.streams.velocities import Axes, Command, Velocities

_WINDOW = 2.0  # the sender's clock is compared with the controller's over this time [s]
_NEW_CLOCK = 1.0  # a sender's time that jumps back by more shows another start [s]
# Waypoints that were passed are kept so long, to estimate velocities, and so are pieces
_KEPT = 1.0  # [s]: an integrator may ask for earlier times.
MOST = 4096  # most waypoints that are kept
_APART = 0.01  # between neighbours for derivatives [s]; closer ones differ by noise


class SenderClock:
    """The time of a sender's clock on the controller's clock.

    A message needs an unknown time to arrive; the one that needed least shows the
    difference of the clocks best.
    """

    def __init__(self) -> None:
        """Begin without a message."""
        self._seen: deque[tuple[float, float]] = deque()
        self._newest = -np.inf

    def restarts_at(self, t: float) -> bool:
        """Return whether a sender's time [s] shows that it has started again."""
        return t < self._newest - _NEW_CLOCK

    def to_controller(self, t: float, now: float) -> float:
        """Return a sender's time on the controller's clock; its message arrived now."""
        if self.restarts_at(t):
            self._seen.clear()
            self._newest = t
        self._newest = max(self._newest, t)
        while self._seen and self._seen[0][0] < now - _WINDOW:
            self._seen.popleft()
        while self._seen and self._seen[-1][1] >= now - t:
            self._seen.pop()  # never the smallest again
        self._seen.append((now, now - t))
        return t + self._seen[0][1]


class Waypoints:
    """Values and times, in order of time."""

    def __init__(self) -> None:
        """Begin without waypoints."""
        self.times: list[float] = []
        self.values: list[Array] = []
        self.velocities: list[Array | None] = []
        self.late = 0
        self._clock = SenderClock()
        self._made = -np.inf  # when the newest message was made
        self._superseded = -np.inf  # what was made before this no longer counts

    def copy(self) -> "Waypoints":
        """Return waypoints that go on from here by themselves."""
        other = copy(self)
        other._clock = deepcopy(self._clock)
        other.times, other.values = self.times.copy(), self.values.copy()
        other.velocities = self.velocities.copy()
        return other

    def add(self, message: Message, now: float, delay: float, replace: bool) -> bool:
        """Add a message's waypoints; return whether it changes what lies ahead."""
        made = now
        if message.t is not None:
            if self._clock.restarts_at(message.t):
                self.clear()
                self._made = self._superseded = -np.inf
            made = self._clock.to_controller(message.t, now)
        alone = message.values is None
        newer = replace or message.chunk or alone
        if made < (self._made if newer else self._superseded):
            self.late += 1
            return False
        times = made + delay + message.times
        behind = times[-1] <= now and bool(self.times) and self.times[-1] > now
        if behind and not newer:
            self.late += 1
            return False
        self._made = max(made, self._made)
        if newer:
            self._superseded = made
        if alone or replace:
            self.clear()
        elif message.chunk:
            self._cut(self.ahead(now))
        if message.values is None:
            return True
        given = message.velocities
        rates: list[Array | None] = [None] * len(times) if given is None else [*given]
        if not self.times or times[0] > self.times[-1]:
            self.times += times.tolist()
            self.values += [*message.values]
            self.velocities += rates
            return True
        for time, value, velocity in zip(times, message.values, rates, strict=True):
            self._insert(float(time), value, velocity)
        return True

    def ahead(self, t: float) -> int:
        """Return the index of the first waypoint later than a time [s]."""
        return bisect_right(self.times, t)

    def near(self, t: float, window: float, most: int) -> slice:
        """Return which waypoints matter at a time: some passed ones, ``most`` ahead."""
        ahead = self.ahead(t)
        first = min(bisect_left(self.times, t - window), max(ahead - 3, 0))
        return slice(max(first, ahead - most), ahead + most)

    def forget(self, t: float) -> None:
        """Forget waypoints that were passed long before a time [s], and the surplus."""
        gone = max(bisect_left(self.times, t - _KEPT), len(self.times) - MOST)
        gone = min(gone, max(len(self.times) - 1, 0))  # the last one is the goal
        if gone > 0:
            for each in (self.times, self.values, self.velocities):
                del each[:gone]

    def clear(self) -> None:
        """Forget all waypoints."""
        self._cut(0)

    def _cut(self, k: int) -> None:
        del self.times[k:], self.values[k:], self.velocities[k:]

    def _insert(self, time: float, value: Array, velocity: Array | None) -> None:
        k = bisect_left(self.times, time)
        if k < len(self.times) and self.times[k] == time:
            self.values[k], self.velocities[k] = value, velocity
            return
        self.times.insert(k, time)
        self.values.insert(k, value)
        self.velocities.insert(k, velocity)


def derivatives(times: Array, x: Array, k: int, window: float) -> tuple[Array, ...]:
    """Return x_k, x_k' and x_k'' of a parabola through waypoints, shape (n,) each.

    Through a waypoint and its two neighbours, at least `_APART` from it; or, with a
    window, nearest to all waypoints not farther from it in time, which smooths noise
    (Savitzky and Golay).

    Shapes: times (m,) [s], x (m, n).
    """
    if window > 0.0:
        wide = slice(*np.searchsorted(times, [times[k] - window, times[k] + window]))
        if wide.stop - wide.start > 3:
            return _nearest_parabola(times[wide] - times[k], x[wide])
    i = min(int(np.searchsorted(times, times[k] - _APART, "right")) - 1, k - 1)
    j = max(int(np.searchsorted(times, times[k] + _APART)), k + 1)
    if i >= 0 and j < len(times):
        before, after = times[k] - times[i], times[j] - times[k]
        back, forth = (x[k] - x[i]) / before, (x[j] - x[k]) / after
        curve = 2.0 * (forth - back) / (before + after)
        return x[k], (after * back + before * forth) / (before + after), curve
    i, j = max(i, 0), min(j, len(times) - 1)
    slope = (x[j] - x[i]) / (times[j] - times[i])
    return x[k], slope, np.zeros_like(slope)


def _nearest_parabola(tau: Array, x: Array) -> tuple[Array, ...]:
    """Return the value and derivatives at tau = 0 of the least-squares parabola."""
    scale = float(np.abs(tau).max())
    powers = np.vander(tau / scale, 3, increasing=True)
    c = np.linalg.lstsq(powers, x, rcond=None)[0]
    return c[0], c[1] / scale, 2.0 * c[2] / scale**2


_CONSIDERED = 256  # the reference joins one of the next waypoints, at most this many
_AT_ONCE = 256  # of more messages that come at once the oldest do not count


class Policy(NamedTuple):
    """How messages become goals; see `Stream` for the attributes."""

    name: str
    delay: float
    smoothing: float
    extrapolation: float
    hold_after: float
    stop_after: float
    dead_man: float
    axes: Axes


class RunningStream:
    """The reference of one run."""

    def __init__(
        self,
        chart: Chart,
        bounds: MotionBounds,
        policy: Policy,
        source: Reader,
        start: State,
    ) -> None:
        """Begin at rest."""
        self.chart, self._policy, self._source = chart, policy, source
        self._joiner = Joiner(bounds, chart.linear)
        self._velocities = Velocities(chart, bounds)
        self._begin = self._now = self._oldest = -inf
        self._heard = -inf
        self._silent = False
        # the velocity that is commanded, until it fades, unless it is repeated
        self._command: Command | None = None
        self._fades_at = inf
        self._segments: list[Segment] = [coast(0.0, inf, start)]
        self._starts = [-inf]
        self.taken = self.refused = 0
        self.waypoints = Waypoints()
        self._kept: dict[float, float] = {}

    @property
    def age(self) -> float:
        """Time since the last message, or since the run began [s]."""
        return self._now - max(self._heard, self._begin) if self._now > -inf else 0.0

    def at(self, t: float) -> State:
        """Return the reference at a time [s]; see `Chart`."""
        if t > self._now:
            self._advance(t)
        elif t < self._oldest:
            raise StreamError(
                f"the reference at t = {t:g} s is not known any more: the run is at "
                f"{self._now:g} s; begin another one with controller.restart()"
            )
        k = max(bisect_right(self._starts, t) - 1, 0)
        return self._segments[k].state(t)

    def keep(self, since: float, until: float) -> None:
        """Know the reference from a time on until a later one [s]."""
        self._kept[since] = max(until, self._kept.get(since, -inf))

    def catch_up(self, reader: Reader) -> None:
        """Hear first what a reader has taken in its run already."""
        self._source.catch_up(reader)

    def copy(self) -> "RunningStream":
        """Return one that goes on from here by itself."""
        other = copy(self)
        other._kept = self._kept.copy()
        other._source = self._source.copy()
        other._segments, other._starts = self._segments.copy(), self._starts.copy()
        other.waypoints = self.waypoints.copy()
        return other

    def _advance(self, t: float) -> None:
        """Plan up to a time: first what follows by itself, then for new messages."""
        if self._now == -inf:  # what is computed at the very start is not yet the run
            self._now = self._begin = t
            return
        for at, group in groupby(self._source.take(t), key=lambda each: each.at):
            messages = [*group]
            surplus = max(len(messages) - _AT_ONCE, 0)
            self.taken += surplus
            self.waypoints.late += surplus
            self._step(max(at, self._now), messages[surplus:])
        self._step(t, [])
        if self.age > self._policy.stop_after:
            raise StreamError(
                f"no message for {self.age:.3g} s; stop_after is "
                f"{self._policy.stop_after:g}"
            )
        self._forget(t)

    def _step(self, t: float, messages: Sequence[Message]) -> None:
        """Plan up to a time at which messages arrive."""
        self._now = t
        while (due := min(self._segments[-1].end, self._fades_at)) <= t:
            if due == self._fades_at and self._command is not None:
                still = np.zeros_like(self._command.velocity)
                self._command = self._command._replace(velocity=still)
                self._fades_at = inf
            self._plan(due)
        changed = False
        for message in messages:
            changed = self._accept(message, t) or changed
        silent = self._falls_silent()
        if changed or silent:
            self._plan(t)

    def _accept(self, message: Message, t: float) -> bool:
        """Take a message; return whether it changes what lies ahead."""
        policy = self._policy
        self.taken += 1
        self._heard = t
        only_newest = policy.name == "latest"
        if not self.waypoints.add(message, t, policy.delay, only_newest):
            return False
        before, self._command, self._fades_at = self._command, None, inf
        if message.values is None:
            assert message.velocities is not None
            axes = message.axes or policy.axes
            self._command = Command(message.velocities[0], axes)
            self._fades_at = t + policy.dead_man
            return self._silent or not self._command.same(before)
        return True

    def _falls_silent(self) -> bool:
        """Return whether the reference must come to rest now, for want of messages."""
        was, self._silent = self._silent, self.age > self._policy.hold_after
        return self._silent and not was

    def _plan(self, t: float) -> None:
        """Begin another piece at a time."""
        state = self.chart.rebased(self._segments[-1].state(t))
        try:
            following = self._next(t, state)
        except StreamError:  # so far away that no motion is found
            self.refused += 1
            self._command, self._fades_at = None, inf
            self.waypoints.clear()
            following = self._to_rest(t, state)
        if self._segments[-1].start == t:  # replaced before anything could see it
            del self._segments[-1], self._starts[-1]
        self._segments.append(following)
        self._starts.append(t)

    def _next(self, t: float, state: State) -> Segment:
        policy, waypoints = self._policy, self.waypoints
        if self._silent:
            return self._to_rest(t, state)
        if self._command is not None:
            return self._velocities.follow(t, state, self._command, policy.delay)
        if not waypoints.times:
            return self._to_rest(t, state)
        if len(waypoints.times) == 1 and self._ends_at_rest:
            to = waypoints.values[0], waypoints.times[0], policy.delay
            return self._joiner.to_target(t, state, *to)
        used = waypoints.near(t, policy.smoothing, _CONSIDERED)
        first = used.start
        values = np.array(waypoints.values[used])
        times = np.array(waypoints.times[used])
        x = self.chart.local(values, state.base)
        last, ahead = len(times) - 1, int(np.searchsorted(times, t, "right"))
        goals = _Goals(self.chart, waypoints, times, x, first, state.base)
        for k in _candidates(ahead, last):
            goal = goals.passed(k, policy.smoothing)
            if k == ahead == last and self._ends_at_rest:
                goal = goal.at_rest()  # no message shows how it goes on
            if (smooth := self._joiner.smooth(t, state, goal)) is not None:
                return smooth
        goal = goals.passed(last, policy.smoothing)
        end = goal.time + (0.0 if self._ends_at_rest else policy.extrapolation)
        if goal.rate.any() and not self._ends_at_rest and t >= end:
            return self._to_rest(t, state)
        if goal.rate.any() and t < end:
            return self._meet(t, state, goal, end)
        if _on_line(state, goal.at_rest(), t):
            return self._to_rest(t, state)
        return self._joiner.fastest(t, state, goal.at_rest())

    @property
    def _ends_at_rest(self) -> bool:
        """Whether the reference comes to rest at the last waypoint, not beyond it."""
        given = self.waypoints.velocities[-1] is not None
        return self._policy.name != "extrapolate" and not given

    def _meet(self, t: float, state: State, goal: Goal, end: float) -> Segment:
        """Return a piece that meets a goal that moves, in ``delay`` or later."""
        if _on_line(state, goal, t):
            return coast(t, end, state)
        soon = t + self._policy.delay
        if soon <= end:
            met = goal._replace(time=soon, x=goal.at(soon))
            if (smooth := self._joiner.smooth(t, state, met)) is not None:
                return smooth
        meeting = self._joiner.fastest(t, state, goal)
        meeting.end = min(meeting.end, end)  # unless a message shows how it goes on
        return meeting

    def _to_rest(self, t: float, state: State) -> Segment:
        """Return a piece that brakes, or stays."""
        still = Command(np.zeros_like(state.x), "world")
        return self._velocities.follow(t, state, still, self._policy.delay)

    def _forget(self, t: float) -> None:
        """Forget pieces and waypoints that lie far behind."""
        self.waypoints.forget(t)
        oldest = t - _KEPT
        for since, until in [*self._kept.items()]:
            if until < oldest:
                del self._kept[since]
            else:
                oldest = min(oldest, since)
        gone = bisect_right(self._starts, oldest) - 1
        if gone > 0:
            del self._segments[:gone], self._starts[:gone]
            self._oldest = self._starts[0]


class _Goals:
    """Waypoints in local coordinates, with the derivatives that they have there."""

    def __init__(
        self,
        chart: Chart,
        waypoints: Waypoints,
        times: Array,
        x: Array,
        first: int,
        base: Array,
    ) -> None:
        """Keep the waypoints from ``first`` on: times (m,) and coordinates (m, n)."""
        self._chart, self._times, self._x, self._base = chart, times, x, base
        self._given = waypoints.velocities[first : first + len(times)]
        self._more = first + len(times) < len(waypoints.times)

    def passed(self, k: int, smoothing: float) -> Goal:
        """Return waypoint k with the derivatives that it was given, or shows."""
        time, x, given = float(self._times[k]), self._x[k], self._given[k]
        still = np.zeros_like(x)
        if given is not None:
            return Goal(time, x, self._chart.local_rate(x, given, self._base), still)
        if len(self._times) == 1:
            return Goal(time, x, still, still)
        x, rate, curve = derivatives(self._times, self._x, k, smoothing)
        newest = k == len(self._times) - 1 and not self._more
        return Goal(time, x, rate, still if newest else curve)


def _candidates(first: int, last: int) -> list[int]:
    """Return which waypoints to try: the next ones closely, later ones more widely."""
    found: list[int] = []
    while first <= last:
        found.append(first)
        first += 1 + len(found) ** 2 // 8
    return found


def _steady(state: State) -> bool:
    return bool(np.abs(state.acceleration).max() < SAME)


def _on_line(state: State, goal: Goal, t: float) -> bool:
    """Return whether a state moves with a goal already."""
    apart = np.abs(state.x - goal.at(t)).max(), np.abs(state.rate - goal.rate).max()
    return max(apart) < SAME and _steady(state)
