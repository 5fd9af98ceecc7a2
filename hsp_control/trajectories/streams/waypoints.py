"""Waypoints on the controller's clock."""

from bisect import bisect_left, bisect_right
from collections import deque
from copy import copy, deepcopy

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.trajectories.streams.message import Message

WINDOW = 2.0
"""Time over which the sender's clock is compared with the controller's [s]."""
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
        while self._seen and self._seen[0][0] < now - WINDOW:
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
        due = made + delay
        times = [due + time for time in message.times.tolist()]
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
            self.times += times
            self.values += [*message.values]
            self.velocities += rates
            return True
        for time, value, velocity in zip(times, message.values, rates, strict=True):
            self._insert(time, value, velocity)
        return True

    def ahead(self, t: float) -> int:
        """Return the index of the first waypoint later than a time [s]."""
        return bisect_right(self.times, t)

    def near(self, t: float, window: float) -> tuple[int, int]:
        """Return which waypoints matter at a time: from the first to before the end."""
        if len(self.times) == 1:
            return 0, 1
        ahead = self.ahead(t)
        first = min(bisect_left(self.times, t - window), max(ahead - 3, 0))
        end = min(ahead + CONSIDERED, len(self.times))
        return max(first, ahead - CONSIDERED), end

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
