"""The reference of a stream: messages become waypoints, and a motion, piece by piece.

Whenever a message arrives, the rest of the reference is planned again from its present
state (x, x', x''). A piece, once begun, never changes; so the reference is a C²
function of time for any messages and any sampling.
"""

from bisect import bisect_right
from collections.abc import Sequence
from copy import copy
from itertools import groupby
from math import inf
from typing import NamedTuple

import numpy as np

from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.message import Message
from hsp_control.trajectories.streams.segments import MotionBounds, Segment, coast
from hsp_control.trajectories.streams.velocities import (
    Axes,
    Velocities,
    VelocityCommand,
)
from hsp_control.trajectories.streams.waypoints import KEPT, Passing, Waypoints

_AT_ONCE = 256  # maximum number of simultaneous messages; the oldest others are ignored


class Policy(NamedTuple):
    """The conversion of messages to goals; see `Stream` for the attributes."""

    name: str
    delay: float
    smoothing: float
    extrapolation: float
    hold_after: float
    stop_after: float
    dead_man: float
    axes: Axes


class Planner:
    """Plans the reference of one run."""

    def __init__(
        self,
        chart: Chart,
        bounds: MotionBounds,
        policy: Policy,
        start: State,
    ) -> None:
        """Begin at rest."""
        self.chart, self._policy = chart, policy
        self._passing = Passing(chart, bounds)
        self._velocities = Velocities(chart, bounds)
        self._begin = self.now = self._oldest = -inf
        self._heard = -inf
        self._silent = False
        # the commanded velocity, until it fades, unless it is repeated
        self._command: VelocityCommand | None = None
        self._fades_at = inf
        self._segments: list[Segment] = [coast(0.0, inf, start)]
        self._starts = [-inf]
        self.taken = self.refused = 0
        self.waypoints = Waypoints()
        self._kept: dict[float, float] = {}

    @property
    def begun(self) -> bool:
        """Whether the run has begun, that is advanced beyond its start."""
        return self.now > -inf

    @property
    def age(self) -> float:
        """Time since the last message, or since the run began [s]."""
        return self.now - max(self._heard, self._begin) if self.begun else 0.0

    def at(self, t: float) -> State:
        """Return the reference at a planned time [s]; see `Chart`."""
        if t < self._oldest:
            raise StreamError(
                f"the reference at t = {t:g} s is not known any more: the run is at "
                f"{self.now:g} s; begin another one with controller.restart()"
            )
        k = max(bisect_right(self._starts, t) - 1, 0)
        return self._segments[k].state(t)

    def keep(self, since: float, until: float) -> None:
        """Keep the reference from a time on until a later one [s]."""
        self._kept[since] = max(until, self._kept.get(since, -inf))

    def copy(self) -> "Planner":
        """Return a copy that continues independently."""
        other = copy(self)
        other._kept = self._kept.copy()
        other._segments, other._starts = self._segments.copy(), self._starts.copy()
        other.waypoints = self.waypoints.copy()
        return other

    def advance(self, t: float, messages: Sequence[Message]) -> None:
        """Plan up to a time [s]: first without, then with the new messages."""
        if not self.begun:
            self.now = self._begin = t
            return
        for at, group in groupby(messages, key=lambda each: each.at):
            together = [*group]
            surplus = max(len(together) - _AT_ONCE, 0)
            self.taken += surplus
            self.waypoints.late += surplus
            self._step(max(at, self.now), together[surplus:])
        self._step(t, [])
        if self.age > self._policy.stop_after:
            raise StreamError(
                f"no message for {self.age:.3g} s; stop_after is "
                f"{self._policy.stop_after:g}"
            )
        self._forget(t)

    def _step(self, t: float, messages: Sequence[Message]) -> None:
        """Plan up to a time at which messages arrive."""
        self.now = t
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
        """Store a message; return whether it changes the future reference."""
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
            self._command = VelocityCommand(message.velocities[0], axes)
            self._fades_at = t + policy.dead_man
            return self._silent or not self._command.same(before)
        return True

    def _falls_silent(self) -> bool:
        """Return whether the reference must come to rest now, for lack of messages."""
        was, self._silent = self._silent, self.age > self._policy.hold_after
        return self._silent and not was

    def _plan(self, t: float) -> None:
        """Begin another piece at a time."""
        state = self.chart.rebased(self._segments[-1].state(t))
        try:
            following = self._next(t, state)
        except StreamError:  # too far away for a motion
            self.refused += 1
            self._command, self._fades_at = None, inf
            self.waypoints.clear()
            following = self._to_rest(t, state)
        if self._segments[-1].start == t:  # replaced before it was sampled
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
        return self._passing.through(
            t,
            state,
            waypoints,
            delay=policy.delay,
            smoothing=policy.smoothing,
            extrapolation=policy.extrapolation,
            rests=policy.name != "extrapolate" and waypoints.velocities[-1] is None,
        )

    def _to_rest(self, t: float, state: State) -> Segment:
        """Return a piece that brakes, or rests."""
        still = VelocityCommand(np.zeros_like(state.x), "world")
        return self._velocities.follow(t, state, still, self._policy.delay)

    def _forget(self, t: float) -> None:
        """Drop pieces and waypoints that are long past."""
        self.waypoints.forget(t)
        oldest = t - KEPT
        for since, until in [*self._kept.items()]:
            if until < oldest:
                del self._kept[since]
            else:
                oldest = min(oldest, since)
        gone = bisect_right(self._starts, oldest) - 1
        if gone > 0:
            del self._segments[:gone], self._starts[:gone]
            self._oldest = self._starts[0]
