"""The reference of a stream in a run, which the engine plans from messages.

Whenever messages are taken, the rest of the reference is planned again from its present
state (x, x', x''). A piece, once begun, never changes; so the reference is a C²
function of time for any messages and any sampling. All of it is one call of the engine
(``engine/streams/stream.hpp``), in Python as in a frozen controller; its memory is
arrays, and Python keeps the pieces of the last second.
"""

from bisect import bisect_right
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from math import ceil, inf
from typing import Any, NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import StreamError
from hsp_control.engine.plans import TIME, PartCall, PartCalls
from hsp_control.trajectories.streams.bounds import MotionBounds
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.message import Axes, Message

SOON = 1e-3  # time of a rehearsed step [s]
KEPT = 1.0
"""Time for which the reference is known after a time [s]."""
MOST = 4096  # maximum number of stored waypoints
_AT_ONCE = 256  # maximum number of simultaneous messages; the oldest others are ignored
_CONSIDERED = 256  # waypoints before and after a time: see `KnownWaypoints`
_CLOCK = 2.0  # over which the sender's clock is compared with the controller's [s]
_HEAD, _ROWS = 13, 52
"""Numbers of a piece: of all of it, and of each coordinate; see
``engine/streams/piece.hpp``."""


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


class Room(NamedTuple):
    """Maximum numbers of the elements that a planner's memory contains."""

    messages: int = 4  # rows of the queue: messages, and waypoints of a chunk
    waypoints: int = 16
    pieces: int = 8  # pieces that may begin in one step and are stored
    arrivals: int = 512  # of messages, for the estimate of the sender's clock

    @classmethod
    def without_python(cls, policy: Policy, period: float) -> "Room":
        """Return the room for a message every period [s], which no call extends."""
        arrivals = ceil(1.1 * _CLOCK / period) + 2  # periods are not exactly equal
        most = 1
        if policy.name != "latest":
            passed = max(min(policy.smoothing, KEPT) / period, 3.0)
            found = min(passed, _CONSIDERED) + policy.delay / period
            most = min(ceil(1.1 * found) + 2, MOST)
        return cls(messages=8, waypoints=most, pieces=1, arrivals=arrivals)


class Planner:
    """Plans the reference of one run.

    A copy continues independently.

    Attributes:
        chart: The coordinates.
        policy: The conversion of messages to goals.
        state: The reference at a time, in its chart: always the same arrays.
        sent: Next message of a program without Python: ``target``, initially the start
        (linear coordinates, then perhaps a quaternion (x, y, z, w)), ``velocity``
        (linear, then angular), and the next target's ``rate`` and ``time`` [s].
        call: The engine's call, of the kind Stream.
    """

    def __init__(
        self,
        chart: Chart,
        bounds: MotionBounds,
        policy: Policy,
        start: State,
        room: Room = Room(),  # noqa: B008 (a value)
    ) -> None:
        """Begin at rest."""
        self.chart, self.policy, self._bounds = chart, policy, bounds
        self.state = State.allocate(chart.size)
        self._begin, self._room = start, room
        self._memory = _memory(room, chart)
        self.restart()
        self._past: list[Array] = []  # earlier pieces, as numbers
        self._starts: list[float] = []  # and when they begin [s]
        self._oldest = self._start = -inf  # of the waypoints, and of the present piece
        self._number = 0  # of the present piece
        self._kept: dict[float, float] = {}
        self.now = -inf
        self._bind()

    def _bind(self) -> None:
        """Make the calls of the present memory."""
        policy, memory = self.policy, self._memory
        self._arguments: dict[str, Any] = {
            "linear": self.chart.linear,
            "policy": _POLICIES.index(policy.name),
            "delay": policy.delay,
            "smoothing": policy.smoothing,
            "extrapolation": policy.extrapolation,
            "dead_man": policy.dead_man,
            "hold_after": policy.hold_after,
            "stop_after": policy.stop_after,
            "tool": policy.axes == "tool",
            "bounds": self._bounds,
            "out": vars(self.state),
            **_nested(memory),
        }
        self.sent = {name: memory[f"sent.{name}"] for name in _SENT}
        self.call = engine.Stream(**self._arguments)
        self._earlier = np.zeros(memory["pieces"].shape[1])
        self._evaluate = engine.PieceState(piece=self._earlier, out=vars(self.state))
        self._queued, self._known = memory["queue.count"], memory["waypoints.count"]
        self._what, self._times = memory["queue.what"], memory["queue.times"]
        self._values, self._rates = memory["queue.values"], memory["queue.rates"]
        self._received, self._begun = memory["received"], memory["begun"]
        self._piece, self._pieces = memory["piece"], memory["pieces"]

    # -- the reference ----------------------------------------------------------------

    def bring(self, t: float) -> None:
        """Bring `state` to a time that was planned [s].

        Raises:
            StreamError: If the time is long past.
        """
        if self._piece.item() != self._number:
            self._remember()
            if self._starts:
                self._forget(self.now)
        if t < self._start:
            if t < self._oldest:
                raise StreamError(
                    f"the reference at t = {t:g} s is not known any more: the run is "
                    f"at {self.now:g} s; begin another one with controller.restart()"
                )
            k = max(bisect_right(self._starts, t) - 1, 0)
            self._earlier[:] = self._past[k]
            self._evaluate(t)
        else:
            self.call(t)

    def advance(self, t: float, messages: Sequence[Message]) -> None:
        """Bring `state` to a later time [s], with the messages taken by then.

        Raises:
            StreamError: If there was no message for too long, or there is no motion.
        """
        if len(messages) > _AT_ONCE:
            messages = self._newest(messages)
        if messages:
            self._make_room(messages)
            for message in messages:
                self._put(message)
        moves = self.call(t)
        self.now = float(t)
        begun = self._piece.item() - self._number
        # A step with messages does most of the work: it is left to the next one, unless
        # that has some, too.
        if not messages or begun > self._room.pieces // 2:
            if begun:
                self._remember()
            if self._starts:
                self._forget(t)
        if not moves:
            if self._memory["lost"].item():
                raise StreamError("no motion within the bounds was found")
            raise StreamError(
                f"no message for {self.age:.3g} s; stop_after is "
                f"{self.policy.stop_after:g}"
            )

    def keep(self, since: float, until: float) -> None:
        """Keep the reference from a time on until a later one [s]."""
        self._kept[since] = max(until, self._kept.get(since, -inf))

    def _remember(self) -> None:
        """Keep the pieces that are followed by others now."""
        number, last, room = self._number, self._piece.item(), len(self._pieces)
        if last - number >= room:  # those in between are no longer stored
            number = last - room + 1
            self._past.clear()
            self._starts.clear()
            self._oldest = self._pieces[number % room, 1].item()
        for k in range(number, last):
            self._past.append(self._pieces[k % room].copy())
            self._starts.append(self._past[-1][1].item())
        self._start, self._number = self._pieces[last % room, 1].item(), last

    def _forget(self, t: float) -> None:
        """Drop pieces that are long past."""
        oldest = t - KEPT
        if (self._starts[1] if len(self._starts) > 1 else self._start) > oldest:
            return
        for since, until in [*self._kept.items()]:
            if until < oldest:
                del self._kept[since]
            else:
                oldest = min(oldest, since)
        gone = bisect_right([*self._starts[1:], self._start], oldest)
        del self._past[:gone], self._starts[:gone]
        self._oldest = self._starts[0] if self._starts else self._start

    # -- messages ---------------------------------------------------------------------

    def _put(self, message: Message) -> None:
        """Add a message to the queue."""
        first = self._queued.item()
        rows = slice(first, first + len(message.what))
        self._what[rows], self._times[rows] = message.what, message.times
        if message.values is not None:
            self._values[rows] = message.values
        if message.velocities is not None:
            self._rates[rows] = message.velocities
        self._queued[0] = rows.stop

    def _newest(self, messages: Sequence[Message]) -> Sequence[Message]:
        """Return messages without those of a time when there are too many."""
        found = list[Message]()
        for k, each in enumerate(messages):
            if k + _AT_ONCE < len(messages) and messages[k + _AT_ONCE].at == each.at:
                self._memory["taken"] += 1
                self._memory["late"] += 1
            else:
                found.append(each)
        return found

    def _make_room(self, messages: Sequence[Message]) -> None:
        """Make sure that messages can be taken."""
        rows = self._queued.item() + sum(len(each.what) for each in messages)
        waypoints = min(self._known.item() + rows, MOST)
        room, before = self._room, self._memory
        if rows <= room.messages and waypoints <= room.waypoints:
            return
        self._room = room._replace(
            messages=max(room.messages, 2 * rows),
            waypoints=max(room.waypoints, min(2 * waypoints, MOST)),
        )
        self._memory = _memory(self._room, self.chart)
        for name, array in before.items():
            self._memory[name][tuple(slice(n) for n in array.shape)] = array
        self._bind()

    # -- statistics -------------------------------------------------------------------

    @property
    def begun(self) -> bool:
        """Whether the run has begun, that is advanced beyond its start."""
        return self.now > -inf

    @property
    def age(self) -> float:
        """Time since the last message, or since the run began [s]."""
        if not self.begun:
            return 0.0
        return self.now - float(max(self._received.item(), self._begun.item()))

    def count(self, of: str) -> int:
        """Return the numbers of ``taken``, ``late`` and ``refused`` messages."""
        return int(self._memory[of].item())

    # -- copies -----------------------------------------------------------------------

    def copy(self) -> "Planner":
        """Return a copy that continues independently."""
        other = copy(self)
        other.state = State(**{k: v.copy() for k, v in vars(self.state).items()})
        other._memory = _copied(self._memory)
        other._kept = self._kept.copy()
        other._past, other._starts = self._past.copy(), self._starts.copy()
        other._bind()
        return other

    def __getstate__(self) -> dict[str, Any]:
        """Return all but the calls and their arguments."""
        calls = "call", "_evaluate", "_arguments", "sent"
        return {name: own for name, own in vars(self).items() if name not in calls}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        """Bind the calls."""
        vars(self).update(saved)
        self._bind()

    def rehearse(self, messages: Sequence[Message] = ()) -> None:
        """Plan a move and move nothing, so that no step is the first one that does.

        Args:
            messages: Those that the next step takes; by default one to stay here.
        """
        if messages:
            self._make_room(messages)  # which stays: the next step has no time for it
        with self._taken_back():
            if not self.begun:
                self.advance(0.0, ())
            if not messages:
                self.call(self.now)
                value = self.chart.value_near(self.state)
                messages = [Message.of(None, value[None], None)]
            t = self.now + SOON
            self.advance(t, messages)
            self.advance(t + SOON, ())  # the next step keeps the previous plan

    @contextmanager
    def _taken_back(self) -> Iterator[None]:
        """Undo the plan; an error leaves nothing either."""
        own = vars(self) | {"_kept": self._kept.copy()}
        own |= {"_past": self._past.copy(), "_starts": self._starts.copy()}
        memory = _copied(self._memory)
        try:
            yield
        finally:
            vars(self).update(own)
            for name, array in memory.items():
                self._memory[name][...] = array

    # -- without Python ---------------------------------------------------------------

    def calls(self, out: Any) -> PartCalls:
        """Return the calls that read a program's messages, and write a sample."""
        advance = PartCall(engine.Stream, t=TIME, **self._arguments)
        return [advance, *self.chart.calls(self.state, out)]

    def restart(self) -> None:
        """Begin another run, at the start."""
        for name, array in _memory(self._room, self.chart).items():
            self._memory[name][...] = array
        self._memory["sent.target"][:] = self.chart.value(self._begin)
        self._memory["pieces"][0] = _rest(self._begin)


_SENT = "target", "velocity", "rate", "time"
_POLICIES = "latest", "interpolate", "extrapolate"


def _rest(state: State) -> Array:
    """Return the numbers of a piece that stays in a state."""
    numbers = np.zeros(_HEAD + _ROWS * len(state.x))
    numbers[2] = inf  # a velocity of 0 from t = 0 on
    numbers[4:_HEAD] = state.base.ravel()
    numbers[_HEAD:][: len(state.x)] = state.x
    return numbers


def _memory(room: Room, chart: Chart) -> dict[str, Any]:
    """Return the arrays of a run that has not begun, by the names of the engine."""
    n, width = chart.size, chart.linear + 4 * chart.rotational
    q, k, s = room.messages, room.waypoints, room.arrivals
    never = np.full(1, -inf)

    def count() -> Any:
        return np.zeros(1, dtype=np.int64)

    return {
        "queue.count": count(),
        "queue.what": np.zeros((q, 3), dtype=np.int64),
        "queue.times": np.zeros((q, 3)),
        "queue.values": np.zeros((q, width)),
        "queue.rates": np.zeros((q, n)),
        "waypoints.count": count(),
        "waypoints.times": np.zeros(k),
        "waypoints.values": np.zeros((k, width)),
        "waypoints.rates": np.zeros((k, n)),
        "waypoints.given": np.zeros(k, dtype=bool),
        "waypoints.made": never.copy(),
        "waypoints.superseded": never.copy(),
        "waypoints.clock.newest": never.copy(),
        "waypoints.clock.seen_at": np.zeros(s),
        "waypoints.clock.seen_behind": np.zeros(s),
        "waypoints.clock.first": count(),
        "waypoints.clock.count": count(),
        "pieces": np.zeros((room.pieces, _HEAD + _ROWS * n)),
        "velocity": np.zeros(n),
        "now": never.copy(),
        "begun": never.copy(),
        "received": never.copy(),
        "fades_at": np.full(1, inf),
        **{name: count() for name in _INTEGERS},
        "sent.target": np.zeros(width),
        "sent.velocity": np.zeros(n),
        "sent.rate": np.zeros(n),
        "sent.time": np.zeros(1),
        "sent.moves": count(),
        "sent.timed": count(),
    }


_INTEGERS = (
    *("piece", "commanded", "in_tool", "silent", "lost"),
    *("taken", "late", "refused"),
)


def _copied(memory: Mapping[str, Any]) -> dict[str, Any]:
    return {name: array.copy() for name, array in memory.items()}


def _nested(memory: Mapping[str, Any]) -> dict[str, Any]:
    """Return arrays by name as arguments, of which some are in groups."""
    found: dict[str, Any] = {}
    for name, array in memory.items():
        *groups, last = name.split(".")
        place = found
        for each in groups:
            place = place.setdefault(each, {})
        place[last] = array
    return found
