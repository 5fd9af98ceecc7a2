"""The reference of a stream: messages become waypoints, and a motion, piece by piece.

Whenever a message arrives, the rest of the reference is planned again from its present
state (x, x', x''). A piece, once begun, never changes; so the reference is a C²
function of time for any messages and any sampling.
"""

from bisect import bisect_right
from collections.abc import Sequence
from copy import copy
from math import inf
from typing import NamedTuple

import numpy as np

from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.message import Message
from hsp_control.trajectories.streams.piece_calls import (
    MotionBounds,
    PassingTimes,
    PieceCalls,
    coast,
)
from hsp_control.trajectories.streams.segments import Piece, Segment
from hsp_control.trajectories.streams.velocities import (
    Axes,
    VelocityCommand,
    velocity_piece,
)
from hsp_control.trajectories.streams.waypoints import KEPT, Waypoints

SOON = 1e-3  # when a rehearsed step would be [s]
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


def _together(messages: Sequence[Message]) -> list[tuple[float, list[Message]]]:
    """Return messages by the time when they are taken, in their order."""
    found: list[tuple[float, list[Message]]] = []
    for each in messages:
        if not found or found[-1][0] != each.at:
            found.append((each.at, []))
        found[-1][1].append(each)
    return found


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
        self._policy = policy
        how = PassingTimes(policy.delay, policy.smoothing, policy.extrapolation)
        self._calls = PieceCalls(chart, bounds, how)
        self._still = VelocityCommand(np.zeros(chart.size), "world")
        self._begin = self.now = self._oldest = -inf
        self._heard = -inf
        self._silent = False
        # the commanded velocity, until it fades, unless it is repeated
        self._command: VelocityCommand | None = None
        self._fades_at = inf
        self._segments: list[Segment] = [Piece(coast(0.0, inf, start))]
        self._starts = [-inf]
        self.taken = self.refused = 0
        self.waypoints = Waypoints()
        self._kept: dict[float, float] = {}
        self._due = -inf  # before this time nothing happens without messages

    @property
    def state(self) -> State:
        """The state that `bring` writes: always the same arrays."""
        return self._calls.state

    @property
    def begun(self) -> bool:
        """Whether the run has begun, that is advanced beyond its start."""
        return self.now > -inf

    @property
    def age(self) -> float:
        """Time since the last message, or since the run began [s]."""
        return self.now - max(self._heard, self._begin) if self.begun else 0.0

    def bring(self, t: float) -> None:
        """Bring `state` to the reference at a time that was planned [s]; see `Chart`.

        Raises:
            StreamError: If the time is long past.
        """
        if t < self._oldest:
            raise StreamError(
                f"the reference at t = {t:g} s is not known any more: the run is at "
                f"{self.now:g} s; begin another one with controller.restart()"
            )
        k = -1 if t >= self._starts[-1] else max(bisect_right(self._starts, t) - 1, 0)
        self._segments[k].write(t, self._calls)

    def keep(self, since: float, until: float) -> None:
        """Keep the reference from a time on until a later one [s]."""
        self._kept[since] = max(until, self._kept.get(since, -inf))
        self._due = -inf

    def copy(self) -> "Planner":
        """Return a copy that continues independently."""
        return self._with(copy(self._calls))

    def _with(self, calls: PieceCalls) -> "Planner":
        other = copy(self)
        other._calls = calls
        other._kept = self._kept.copy()
        other._segments, other._starts = self._segments.copy(), self._starts.copy()
        other.waypoints = self.waypoints.copy()
        return other

    def rehearse(self, messages: Sequence[Message] = ()) -> None:
        """Plan a move and move nothing, so that no step is the first one that does.

        Args:
            messages: Those that the next step takes; by default one to stay here.
        """
        other = self._with(self._calls)
        self._segments[-1].write(max(self.now, 0.0), self._calls)
        if not self.begun:
            other.advance(0.0, [])
        t = other.now + SOON
        if not messages:
            value = self._calls.chart.value_near(self.state)
            messages = [Message(None, np.zeros(1), value[None], None, at=t)]
        other.advance(t, messages)
        other.bring(t)

    def advance(self, t: float, messages: Sequence[Message]) -> None:
        """Plan up to a time [s]: first without, then with the new messages."""
        if not self.begun:
            self.now = self._begin = t
            return
        if not messages and t < self._due:
            self.now = t
            return
        for at, together in _together(messages):
            surplus = max(len(together) - _AT_ONCE, 0)
            self.taken += surplus
            self.waypoints.late += surplus
            self._step(max(at, self.now), together[surplus:])
        if messages and self.now == t < min(self._segments[-1].end, self._fades_at):
            self._forget(t)
            self._due = -inf  # the rest is left to the next step: none is due before
            return
        self._step(t, [])
        if self.age > self._policy.stop_after:
            raise StreamError(
                f"no message for {self.age:.3g} s; stop_after is "
                f"{self._policy.stop_after:g}"
            )
        self._forget(t)
        self._due = self._next_event()

    def _next_event(self) -> float:
        """Return the time until which neither a piece begins nor anything is forgotten.

        That is, without messages [s].
        """
        policy, heard = self._policy, max(self._heard, self._begin)
        if self._kept:
            return -inf
        due = min(self._segments[-1].end, self._fades_at, heard + policy.stop_after)
        if not self._silent:
            due = min(due, heard + policy.hold_after)
        for times in (self._starts[1:2], self.waypoints.times[:1]):
            due = min([due, *(time + KEPT for time in times)])
        return due

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
        self._segments[-1].write(t, self._calls)
        following = self._next(t)
        if following is None:  # too far away for a motion
            self.refused += 1
            self._command, self._fades_at = None, inf
            self.waypoints.clear()
            following = self._to_rest(t)
            if following is None:
                raise StreamError("no motion within the bounds was found")
        if self._segments[-1].start == t:  # replaced before anything could see it
            del self._segments[-1], self._starts[-1]
        self._segments.append(following)
        self._starts.append(t)

    def _next(self, t: float) -> Segment | None:
        policy, waypoints = self._policy, self.waypoints
        if self._silent:
            return self._to_rest(t)
        if self._command is not None:
            return velocity_piece(t, self._command, self._calls)
        if not waypoints.times:
            return self._to_rest(t)
        rests = policy.name != "extrapolate" and waypoints.velocities[-1] is None
        numbers = self._calls.through(t, waypoints, rests)
        return None if numbers is None else Piece(numbers)

    def _to_rest(self, t: float) -> Segment | None:
        """Return a piece that brakes, or stays."""
        return velocity_piece(t, self._still, self._calls)

    def _forget(self, t: float) -> None:
        """Drop pieces and waypoints that are long past."""
        self.waypoints.forget(t)
        oldest = t - KEPT
        if not self._kept and (len(self._starts) == 1 or self._starts[1] > oldest):
            return
        for since, until in [*self._kept.items()]:
            if until < oldest:
                del self._kept[since]
            else:
                oldest = min(oldest, since)
        gone = bisect_right(self._starts, oldest) - 1
        if gone > 0:
            del self._segments[:gone], self._starts[:gone]
            self._oldest = self._starts[0]
