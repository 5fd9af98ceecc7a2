"""Waypoints on the controller's clock, and the pieces that pass through them."""

from bisect import bisect_left, bisect_right
from collections import deque
from copy import copy, deepcopy

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.message import Message
from hsp_control.trajectories.streams.segments import (
    MotionBounds,
    Piece,
    Segment,
    found_motion,
    room,
)

_WINDOW = 2.0  # the sender's clock is compared with the controller's over this time [s]
_NEW_CLOCK = 1.0  # jump back of a sender's time that indicates a restart [s]
KEPT = 1.0
"""Time for which passed waypoints are kept, to estimate velocities [s]."""
MOST = 4096  # maximum number of stored waypoints
CONSIDERED = 256
"""Maximum number of next waypoints one of which the reference joins."""


class SenderClock:
    """The time of a sender's clock on the controller's clock.

    A message needs an unknown time to arrive; the fastest one shows the difference of
    the clocks best.
    """

    def __init__(self) -> None:
        """Begin without a message."""
        self._seen: deque[tuple[float, float]] = deque()
        self._newest = -np.inf

    def restarts_at(self, t: float) -> bool:
        """Return whether a sender's time [s] shows that it has restarted."""
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
        self._made = -np.inf  # time of the newest message
        self._superseded = -np.inf  # earlier messages are ignored

    def copy(self) -> "Waypoints":
        """Return a copy that continues independently."""
        other = copy(self)
        other._clock = deepcopy(self._clock)
        other.times, other.values = self.times.copy(), self.values.copy()
        other.velocities = self.velocities.copy()
        return other

    def add(self, message: Message, now: float, delay: float, replace: bool) -> bool:
        """Add a message's waypoints; return whether it changes the future reference."""
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

    def near(self, t: float, window: float) -> slice:
        """Return the relevant waypoints at a time: some passed ones, some ahead."""
        ahead = self.ahead(t)
        first = min(bisect_left(self.times, t - window), max(ahead - 3, 0))
        return slice(max(first, ahead - CONSIDERED), ahead + CONSIDERED)

    def forget(self, t: float) -> None:
        """Drop waypoints that were passed long before a time [s], and the surplus."""
        gone = max(bisect_left(self.times, t - KEPT), len(self.times) - MOST)
        gone = min(gone, max(len(self.times) - 1, 0))  # the last one is the goal
        if gone > 0:
            for each in (self.times, self.values, self.velocities):
                del each[:gone]

    def clear(self) -> None:
        """Remove all waypoints."""
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


class Passing:
    """Plans the pieces through waypoints, within the bounds.

    Each waypoint has its given velocity; or derivatives estimated from its neighbours,
    or those of the parabola nearest to the waypoints around it; see
    ``engine/streams/waypoints.cpp``.
    """

    def __init__(self, chart: Chart, bounds: MotionBounds) -> None:
        """Set the coordinates, and the bounds in them."""
        self._chart, self._bounds = chart, bounds

    def through(
        self,
        t: float,
        state: State,
        waypoints: Waypoints,
        *,
        delay: float,
        smoothing: float,
        extrapolation: float,
        rests: bool,
    ) -> Segment:
        """Return the piece through waypoints, of which there is at least one.

        Args:
            t: Its start time [s].
            state: Its initial state, at the base of its chart.
            waypoints: The waypoints.
            delay: Delay of the reference after a waypoint's own time [s].
            smoothing: Maximum distance in time of smoothed waypoints [s].
            extrapolation: Time for which it continues at the last velocity [s].
            rests: Whether it comes to rest at the last one, not beyond it.

        Raises:
            StreamError: If no motion within the bounds is found.
        """
        near = waypoints.near(t, smoothing)
        times = np.array(waypoints.times[near])
        given = waypoints.velocities[near]
        velocities = np.zeros((len(times), self._chart.size))
        for row, velocity in zip(velocities, given, strict=True):
            if velocity is not None:
                row[:] = velocity
        numbers = room(self._chart.size)
        found = engine.WaypointPiece(
            t=float(t),
            linear=self._chart.linear,
            delay=delay,
            smoothing=smoothing,
            extrapolation=extrapolation,
            more=float(near.stop < len(waypoints.times)),
            rests=float(rests),
            bounds=self._bounds,
            state=vars(state),
            times=times,
            values=np.array(waypoints.values[near]),
            velocities=velocities,
            given=np.array([velocity is not None for velocity in given]),
            piece=numbers,
        )()
        return found_motion(Piece(numbers, state.base) if found else None)
