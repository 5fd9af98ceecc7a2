"""A stream without Python: the targets that a program sends to a frozen controller."""

from math import ceil
from typing import Any

import numpy as np

from hsp_control import engine
from hsp_control.engine.plans import TIME, PartCall, PartCalls
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.piece_calls import MotionBounds, coast
from hsp_control.trajectories.streams.planner import Policy
from hsp_control.trajectories.streams.waypoints import (
    CONSIDERED,
    KEPT,
    MOST,
    WINDOW,
)


class StreamAlone:
    """A `Planner` for targets and velocities that are sent now, as calls.

    Attributes:
        target: The next target to send, initially the start: linear coordinates, then
        perhaps a quaternion (x, y, z, w).
        velocity: The next velocity to send, linear, then angular.
        rate: The velocity of the next target.
        time: The time of the next target by the sender's clock, shape (1,) [s].
        call: The call that receives them, of the kind StreamAlone.
    """

    def __init__(
        self,
        chart: Chart,
        bounds: MotionBounds,
        policy: Policy,
        start: State,
        period: float,
    ) -> None:
        """Begin at rest; ``period``: minimum time between two messages [s]."""
        n, linear = chart.size, chart.linear
        self._chart = chart
        self._state = State.allocate(n)
        value = chart.value(start)
        self.target, self.velocity = value.copy(), np.zeros(n)
        self.rate, self.time = np.zeros(n), np.zeros(1)
        most = _most_waypoints(policy, period)
        seen = ceil(1.1 * WINDOW / period) + 2  # periods are not exactly equal
        self._memory: dict[str, Any] = {
            "piece": coast(0.0, np.inf, start),
            "times": np.zeros(most),
            "values": np.zeros((most, len(value))),
            "rates": np.zeros((most, n)),
            "given": np.zeros(most, dtype=bool),
            "velocity": np.zeros(n),
            "now": np.full(1, -np.inf),
            "begun": np.full(1, -np.inf),
            "heard": np.full(1, -np.inf),
            "fades_at": np.full(1, np.inf),
            "sent_target": self.target,
            "sent_velocity": self.velocity,
            "next_rate": self.rate,
            "sent_rate": np.zeros(n),
            "next_time": self.time,
            "sent_time": np.zeros(1),
            **{name: np.full(1, -np.inf) for name in _TIMES},
            "seen_at": np.zeros(seen),
            "seen_behind": np.zeros(seen),
            **{name: np.zeros(1, dtype=np.int64) for name in _INTEGERS},
        }
        self._first = {name: array.copy() for name, array in self._memory.items()}
        self._arguments: dict[str, Any] = {
            "linear": linear,
            "policy": _POLICIES.index(policy.name),
            "delay": policy.delay,
            "smoothing": policy.smoothing,
            "extrapolation": policy.extrapolation,
            "dead_man": policy.dead_man,
            "hold_after": policy.hold_after,
            "bounds": bounds,
            "out": vars(self._state),
            **self._memory,
        }
        self.call = engine.StreamAlone(**self._arguments)

    def forget(self) -> None:
        """Restart."""
        for name, array in self._memory.items():
            array[:] = self._first[name]

    def calls(self, out: Any) -> PartCalls:
        """Return the calls that write a sample, of whatever the stream moves."""
        advance = PartCall(engine.StreamAlone, t=TIME, **self._arguments)
        return [advance, *self._chart.calls(self._state, out)]


_TIMES = "made", "superseded", "newest"
_INTEGERS = (
    *("count", "commanded", "silent", "sent", "differs", "alone", "targeted"),
    *("next_moves", "sent_moves", "next_timed", "sent_timed"),
    *("seen_first", "seen_count"),
)
_POLICIES = "latest", "interpolate", "extrapolate"


def _most_waypoints(policy: Policy, period: float) -> int:
    """Return the maximum number of relevant waypoints, one each period."""
    if policy.name == "latest":
        return 1
    passed = max(min(policy.smoothing, KEPT) / period, 3.0)
    found = min(passed, CONSIDERED) + policy.delay / period
    return min(ceil(1.1 * found) + 2, MOST)  # periods are not exactly equal
