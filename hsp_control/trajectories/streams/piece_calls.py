"""The engine's calls for the pieces of a stream, bound once, before it runs."""

from typing import Any, NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.trajectories.orientation import OrientationSample
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.waypoints import CONSIDERED, Waypoints


class MotionBounds(NamedTuple):
    """Largest magnitude of the first three derivatives, for each coordinate."""

    speed: Array  # (n,) [1/s]
    acceleration: Array  # (n,) [1/s²]
    jerk: Array  # (n,) [1/s³]


class PassingTimes(NamedTuple):
    """How a reference passes through waypoints, in time."""

    delay: float  # from a waypoint's own time to when the reference is there [s]
    smoothing: float  # waypoints not farther in time are smoothed by a parabola [s]
    extrapolation: float  # how long it goes on at the last velocity [s]


IN_TOOL_AXES = 2.0
"""The engine's record of a piece in which x stands for the integral of u."""
_HEAD, _ROWS = 13, 52
"""Numbers of a piece: of all of it, and of each coordinate; see
``engine/streams/piece.hpp``."""
COAST = 0.0
"""The first number of a piece whose x' is constant."""


def coast(start: float, end: float, state: State) -> Array:
    """Return the numbers of a piece with x' constant; at rest if it is zero."""
    numbers = _room(len(state.x))
    numbers[:3] = COAST, start, end
    numbers[4:_HEAD] = state.base.ravel()
    numbers[_HEAD:][: 2 * len(state.x)] = *state.x, *state.rate
    return numbers


def base_of(numbers: Array) -> Array:
    """Return the orientation of the chart of a piece, shape (3, 3)."""
    return numbers[4:_HEAD].reshape(3, 3)


def _room(n: int) -> Array:
    """Return room for the numbers of a piece with n coordinates."""
    return np.zeros(_HEAD + _ROWS * n)


class PieceCalls:
    """Evaluates pieces, and plans the next one from the state that was evaluated last.

    Copies and pickles have their own arrays: their contents belong to one call.

    Attributes:
        chart: The coordinates.
        state: The state that was evaluated last.
        turned: R, ω and ω' of that state, after `turn`.
    """

    def __init__(self, chart: Chart, bounds: MotionBounds, how: PassingTimes) -> None:
        """Bind the calls."""
        self._given, self.chart, self._how = (chart, bounds, how), chart, how
        n, linear = chart.size, chart.linear
        self.state, self.turned = State.allocate(n), OrientationSample.allocate()
        here = {"state": vars(self.state), "bounds": bounds, "linear": linear}
        self._present, self._next = _room(n), _room(n)
        self._loaded: Array | None = None  # whose numbers the present ones are
        self._evaluate = engine.PieceState(piece=self._present, out=vars(self.state))
        if chart.rotational:
            y = self.state.rotation_vector(linear)
            out = self.turned
            self._turn = engine.OrientationOfChart(base=self.state.base, y=y, out=out)
        most = 2 * CONSIDERED
        self._count = np.ones(1, dtype=np.int64)
        self._more, self._rests = np.zeros(1, dtype=bool), np.zeros(1, dtype=bool)
        self._times, self._known = np.zeros(most), np.zeros(most, dtype=bool)
        self._values = np.zeros((most, linear + 4 * chart.rotational))
        self._velocities = np.zeros((most, n))
        self._through = engine.WaypointPiece(
            **here,
            **how._asdict(),
            count=self._count,
            more=self._more,
            rests=self._rests,
            times=self._times,
            values=self._values,
            velocities=self._velocities,
            given=self._known,
            piece=self._next,
        )
        # the last count, rests and more, and whether any velocity was known
        self._written = 1, False, False, False
        self._velocity, self._tool = np.zeros(n), np.zeros(1, dtype=bool)
        self._follow = engine.VelocityPiece(
            **here,
            delay=how.delay,
            velocity=self._velocity,
            tool=self._tool,
            piece=self._next,
        )

    def evaluate(self, numbers: Array, t: float) -> None:
        """Write the state of a piece at time t [s]."""
        if self._loaded is not numbers:
            self._present[:] = numbers
            self._loaded = numbers
        self._evaluate(t)

    def turn(self) -> None:
        """Write R, ω and ω' of the state."""
        self._turn()

    def through(self, t: float, waypoints: Waypoints, rests: bool) -> Array | None:
        """Return the piece that goes on through waypoints; None: there is no way.

        Each waypoint has the velocity that it was given; or the derivatives that it
        shows with its neighbours, or of the parabola nearest to those around it; see
        ``engine/streams/waypoints.cpp``.

        Args:
            t: When it begins [s].
            waypoints: The waypoints, of which there is one.
            rests: Whether it comes to rest at the last one, not beyond it.
        """
        first, end = waypoints.near(t, self._how.smoothing)
        count = end - first
        if count == 1:  # half the time, where steps have no more
            self._times[0], self._values[0] = (
                waypoints.times[first],
                waypoints.values[first],
            )
        else:
            self._times[:count] = waypoints.times[first:end]
            self._values[:count] = waypoints.values[first:end]
        rates = waypoints.velocities[first:end]
        given = any(each is not None for each in rates)
        written = count, rests, end < len(waypoints.times), given
        if given or written != self._written:  # else half the time
            for k, velocity in enumerate(rates):
                self._known[k] = velocity is not None
                if velocity is not None:
                    self._velocities[k] = velocity
            self._count[0], self._rests[0], self._more[0], _ = written
            self._written = written
        return self._next.copy() if self._through(t) else None

    def follow(
        self, t: float, velocity: Any, *, tool: bool
    ) -> tuple[Array | None, bool]:
        """Return the piece that reaches a velocity, and keeps it; None: no way.

        It takes the ``delay`` [s] if the bounds permit. A velocity beyond the bounds
        keeps its direction. A piece that keeps the velocity has no end.

        Args:
            t: When it begins [s].
            velocity: Linear, then angular, shape (n,) [1/s].
            tool: Whether it is in the body's axes, not the world's.

        Returns:
            The numbers, and whether in them x stands for the integral of u, x' = R u.
        """
        self._velocity[:], self._tool[0] = velocity, tool
        found = self._follow(t)
        return (self._next.copy() if found else None), found == IN_TOOL_AXES

    def __reduce__(self) -> tuple[type, tuple[Any, ...]]:
        return type(self), self._given
