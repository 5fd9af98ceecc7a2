"""The waypoints that a stream has received, on the controller's time."""

from bisect import bisect_left, bisect_right
from collections import deque

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.trajectories.streams.message import Message

_WINDOW = 2.0
"""The sender's clock is compared with the controller's over this time [s]."""
_NEW_CLOCK = 1.0
"""A sender whose time jumps back by more than this has started again [s]."""
_KEPT = 1.0
"""Waypoints that were passed are kept for this time, to estimate velocities [s]."""
MOST = 2048
"""Most waypoints that are kept."""


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
    """Values and times, in order of time.

    Attributes:
        times: When the reference should be there, increasing [s].
        values: Values as they were sent, shape (width,) each.
        velocities: Their velocities, shape (rates,) each; None where unknown.
        late: How many messages came too late to count.
    """

    def __init__(self) -> None:
        """Begin without waypoints."""
        self.times: list[float] = []
        self.values: list[Array] = []
        self.velocities: list[Array | None] = []
        self.late = 0
        self._clock = SenderClock()
        self._made = -np.inf  # when the newest message was made

    def add(self, message: Message, now: float, delay: float, replace: bool) -> bool:
        """Add a message's waypoints; return whether it changes what lies ahead.

        Args:
            message: The message.
            now: When it arrived [s].
            delay: From the time of a waypoint to when the reference is there [s].
            replace: Whether each message replaces all earlier ones. A chunk replaces
                the waypoints after its first one anyhow.
        """
        made = now
        if message.t is not None:
            if self._clock.restarts_at(message.t):
                self.clear()
                self._made = -np.inf
            made = self._clock.to_controller(message.t, now)
        chunk = len(message.times) > 1
        if made < self._made and (replace or chunk):
            self.late += 1
            return False
        times = made + delay + message.times
        if times[-1] <= now and not replace and self.times and self.times[-1] > now:
            self.late += 1
            return False
        self._made = max(made, self._made)
        if message.values is None:
            self.clear()
            return True
        if replace:
            self.clear()
        elif chunk:
            self._cut(bisect_left(self.times, times[0]))
        for k, time in enumerate(times):
            velocity = None if message.velocities is None else message.velocities[k]
            self._insert(float(time), message.values[k], velocity)
        return True

    def ahead(self, t: float) -> int:
        """Return the index of the first waypoint later than a time [s]."""
        return bisect_right(self.times, t)

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

    Through a waypoint and its two neighbours; or, with a window, nearest to all
    waypoints not farther from it in time, which smooths noise (Savitzky and Golay).

    Args:
        times: Shape (m,) [s].
        x: Shape (m, n).
        k: The waypoint, with at least one neighbour.
        window: Half the window [s]; 0: the neighbours.
    """
    if window > 0.0:
        wide = slice(*np.searchsorted(times, [times[k] - window, times[k] + window]))
        if wide.stop - wide.start > 3:
            return _nearest_parabola(times[wide] - times[k], x[wide])
    if 0 < k < len(times) - 1:
        before, after = times[k] - times[k - 1], times[k + 1] - times[k]
        back, forth = (x[k] - x[k - 1]) / before, (x[k + 1] - x[k]) / after
        curve = 2.0 * (forth - back) / (before + after)
        return x[k], (after * back + before * forth) / (before + after), curve
    one, other = (k, k + 1) if k == 0 else (k - 1, k)
    slope = (x[other] - x[one]) / (times[other] - times[one])
    return x[k], slope, np.zeros_like(slope)


def _nearest_parabola(tau: Array, x: Array) -> tuple[Array, ...]:
    """Return the value and derivatives at tau = 0 of the least-squares parabola."""
    scale = float(np.abs(tau).max())
    powers = np.vander(tau / scale, 3, increasing=True)
    c = np.linalg.lstsq(powers, x, rcond=None)[0]
    return c[0], c[1] / scale, 2.0 * c[2] / scale**2
