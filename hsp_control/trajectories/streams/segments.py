"""Pieces of a streamed reference: quintics where they keep the bounds, else Ruckig's.

A piece is a C² function of time, given in local coordinates (`Chart`); each begins with
the state in which the piece before it ends.
"""

from abc import ABC, abstractmethod
from itertools import pairwise
from math import pi, sqrt
from typing import Any, NamedTuple

import numpy as np
import ruckig
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import StreamError, TrajectoryError
from hsp_control.trajectories.piecewise_polynomial import QUINTIC
from hsp_control.trajectories.streams.chart import State
from hsp_control.trajectories.trajectory import TrajectorySample

_PIECES = 4
"""A quintic is cut into this many pieces: the bounds of a Bézier curve by its control
points are then at most a tenth too cautious for a motion from rest to rest."""


class MotionBounds(NamedTuple):
    """Largest magnitude of the first three derivatives, for each coordinate."""

    speed: Array  # (n,) [1/s]
    acceleration: Array  # (n,) [1/s²]
    jerk: Array  # (n,) [1/s³]

    def keep(self, ends: Array, duration: float) -> bool:
        """Return whether a quintic keeps the bounds throughout.

        ``ends`` (6, n) are x, T x', T² x'' at the start, then at the end. The
        derivatives are Bézier curves, between their control points: True is certain,
        False too cautious.
        """
        T, scale = duration, 1.0
        for matrix, bound in zip(DERIVATIVES, self, strict=True):
            scale *= T
            if (np.abs(matrix @ ends).max(axis=0) > bound * scale).any():
                return False
        return True


def linear_bounds(
    speed: ArrayLike, acceleration: ArrayLike, jerk: ArrayLike, n: int
) -> MotionBounds:
    """Return bounds for each of n coordinates."""
    given = {"speed": speed, "acceleration": acceleration, "jerk": jerk}
    found = []
    for name, value in given.items():
        numbers = np.asarray(value, dtype=float)
        if numbers.ndim and numbers.shape != (n,):
            raise TrajectoryError(
                f"{name} has {numbers.size} numbers; the stream needs one or {n}"
            )
        found.append(np.broadcast_to(numbers, (n,)).copy())
    return MotionBounds(*found)


def angular_bounds(speed: float, acceleration: float, jerk: float) -> MotionBounds:
    """Return bounds on a rotation vector that keep those on ω, ω' and ω''; see `Chart`.

    A vector with components up to b/√3 is no longer than b. Each piece has axes of its
    own; where one begins, a component of ω may be beyond its bound while all of ω is
    not, and is then brought back. For that the speed is planned 5 % smaller; what was
    seen in 400 hostile streams is 0.5 %.
    """
    curved = acceleration - speed**2 / pi
    if curved <= 0.0:
        raise TrajectoryError(
            f"angular_acceleration is {acceleration:g}; with angular_speed {speed:g} "
            f"it must be greater than {speed**2 / pi:.4g} (angular_speed²/π)"
        )
    turned = jerk - speed * curved - speed**3 / 6.0
    if turned <= 0.0:
        raise TrajectoryError(
            f"angular_jerk is {jerk:g}; with these bounds it must be greater than "
            f"{speed * curved + speed**3 / 6.0:.4g}"
        )
    planned = PLANNED * speed, curved, turned
    return MotionBounds(*(np.full(3, each / sqrt(3.0)) for each in planned))


PLANNED = 0.95
"""Share of an angular speed up to which motions are planned; see `angular_bounds`."""


def _bezier_points() -> Array:
    """Return what maps the ends of a quintic to its control points, shape (6, 6)."""
    first = np.array([[1, 0, 0], [1, 1 / 5, 0], [1, 2 / 5, 1 / 20]])
    last = np.array([[1, -2 / 5, 1 / 20], [1, -1 / 5, 0], [1, 0, 0]])
    points = np.zeros((6, 6))
    points[:3, :3], points[3:, 3:] = first, last
    return points


def _cut(degree: int, start: float, end: float) -> Array:
    """Return what maps control points to those of the piece from start to end.

    Entry (i, j) is the blossom of Bernstein polynomial j at i times ``end`` and
    degree - i times ``start``.
    """
    rows = np.zeros((degree + 1, degree + 1))
    for i in range(degree + 1):
        ones = np.zeros(degree + 1)
        ones[0] = 1.0
        for k in range(degree):
            u = end if k < i else start
            ones = np.concatenate(
                [[ones[0] * (1 - u)], ones[1:] * (1 - u) + ones[:-1] * u]
            )
        rows[i] = ones
    return rows


def _derivatives() -> tuple[Array, ...]:
    """Return what maps ``ends`` to T^k times the k-th derivative's control points."""
    points, found = _bezier_points(), []
    edges = np.linspace(0.0, 1.0, _PIECES + 1)
    for k in (1, 2, 3):
        degree = 5 - k
        points = (degree + 1) * np.diff(points, axis=0)
        cuts = [_cut(degree, a, b) for a, b in pairwise(edges)]
        found.append(np.vstack([cut @ points for cut in cuts]))
    return tuple(found)


DERIVATIVES = _derivatives()


SHORTEST = 1e-3  # no motion between different states is shorter [s]
SAME = 1e-7  # states that differ by less are the same, in x, x' and x''


class Goal(NamedTuple):
    """Where the reference should be at a time, in local coordinates."""

    time: float  # when [s]
    x: Array  # (n,)
    rate: Array  # x', (n,) [1/s]
    acceleration: Array  # x'', (n,) [1/s²]

    def at(self, t: float) -> Array:
        """Return where it is at another time, at its velocity, shape (n,)."""
        return self.x + (t - self.time) * self.rate

    def at_rest(self) -> "Goal":
        """Return the goal as one to stay at."""
        still = np.zeros_like(self.x)
        return self._replace(rate=still, acceleration=still)


class Segment(ABC):
    """A piece of the reference, from ``start`` to ``end`` [s], about ``base``."""

    def __init__(self, start: float, end: float, base: Array) -> None:
        """Set when it begins and ends, and the orientation of its chart."""
        self.start, self.end, self.base = start, end, base

    @abstractmethod
    def state(self, t: float) -> State:
        """Return the state at time t [s], between start and end."""


class Coast(Segment):
    """x' is constant; at rest if it is zero."""

    def __init__(self, start: float, end: float, state: State) -> None:
        """Begin in a state, whose acceleration is taken to be zero."""
        super().__init__(start, end, state.base)
        self._x, self._rate = state.x.copy(), state.rate.copy()
        self._still = np.zeros_like(state.x)

    def state(self, t: float) -> State:
        """Return the state at time t [s]."""
        moved = self._x + (t - self.start) * self._rate
        return State(moved, self._rate.copy(), self._still.copy(), self.base)


class QuinticSegment(Segment):
    """x is a polynomial of fifth degree: the smoothest motion between two states."""

    def __init__(self, start: float, end: float, base: Array, ends: Array) -> None:
        """Set x, T x', T² x'' at the start, then at the end, shape (6, n)."""
        super().__init__(start, end, base)
        self._found = TrajectorySample.allocate(ends.shape[1])
        self._motion = engine.Polynomial(
            start=self.start,
            end=self.end,
            coefficients=QUINTIC @ ends,
            out=self._found,
        )

    def state(self, t: float) -> State:
        """Return the state at time t [s]."""
        self._motion(t)
        x, rate, acceleration = (each.copy() for each in self._found)
        return State(x, rate, acceleration, self.base)


class FastestTask(NamedTuple):
    """What Ruckig is asked for, in a frame that moves with the target."""

    x: Array  # x at the start, counted from the target, (n,)
    rate: Array  # x' at the start, in the frame, (n,) [1/s]
    acceleration: Array  # x'' at the start, (n,) [1/s²]
    target_rate: Array  # x' at the end, in the frame, (n,) [1/s]
    drift: Array  # velocity of the frame, (n,) [1/s]
    positions: bool  # whether the target is a position; else only a velocity
    together: int  # how many of the coordinates, from the first on, arrive together
    duration: float  # the motion is not shorter [s]

    def solve(self, bounds: MotionBounds) -> ruckig.Trajectory:
        """Return the fastest motion."""
        for synchronization in _SYNCHRONIZATIONS:
            task = self._input(bounds)
            alone = len(self.x) - self.together
            kinds = [synchronization] * self.together + [_ALONE] * alone
            task.per_dof_synchronization = kinds
            motion = ruckig.Trajectory(len(self.x))
            try:
                ruckig.Ruckig(len(self.x)).calculate(task, motion)
            except (ruckig.RuckigError, ValueError) as error:
                reason = str(error)  # ValueError: a motion of more than two hours
            else:
                return motion
        raise StreamError(f"no motion within the bounds was found: {reason:.200}")

    def _input(self, bounds: MotionBounds) -> ruckig.InputParameter:
        size = len(self.x)
        task = ruckig.InputParameter(size)
        # Rounding errors are no distance: Ruckig fails where they are all there is.
        task.current_position = _rounded(self.x)
        task.current_velocity = _rounded(self.rate)
        task.current_acceleration = _rounded(self.acceleration)
        task.target_position = task.target_acceleration = [0.0] * size
        task.target_velocity = _rounded(self.target_rate)
        task.max_velocity = (bounds.speed - self.drift).tolist()
        task.min_velocity = (-bounds.speed - self.drift).tolist()
        task.max_acceleration = bounds.acceleration.tolist()
        task.max_jerk = bounds.jerk.tolist()
        if self.duration > 0.0:
            task.minimum_duration = self.duration
        if not self.positions:
            task.control_interface = ruckig.ControlInterface.Velocity
        return task


def _rounded(x: Array) -> list[float]:
    """Return numbers with those that are nearly zero set to zero."""
    rounded: list[float] = np.where(np.abs(x) < 1e-12, 0.0, x).tolist()
    return rounded


_SYNCHRONIZATIONS = (
    ruckig.Synchronization.Phase,  # on a straight line, where that is possible
    ruckig.Synchronization.Time,
    ruckig.Synchronization.No,
)
_ALONE = ruckig.Synchronization.No
"""How the coordinates belong together: the next where Ruckig fails."""


class Fastest(Segment):
    """The fastest motion within the bounds, by Ruckig, in a frame that may move.

    L. Berscheid, T. Kröger, "Jerk-limited real-time trajectory generation with
    arbitrary target states", RSS 2021.
    """

    def __init__(
        self,
        start: float,
        base: Array,
        task: FastestTask,
        origin: Array,
        bounds: MotionBounds,
    ) -> None:
        """Solve the task, whose frame is at ``origin`` at the start, shape (n,)."""
        self._task, self._origin, self._bounds = task, origin, bounds
        self._motion = task.solve(bounds)
        duration = max(self._motion.duration, SHORTEST)
        super().__init__(start, start + duration, base)

    def state(self, t: float) -> State:
        """Return the state at time t [s]."""
        elapsed, drift = t - self.start, self._task.drift
        x, rate, acceleration = map(np.array, self._motion.at_time(elapsed))
        x += self._origin + elapsed * drift
        return State(x, rate + drift, acceleration, self.base)

    def __reduce__(self) -> tuple[type["Fastest"], tuple[object, ...], dict[str, Any]]:
        """Return how to make it again: Ruckig's motions cannot be pickled."""
        given = self.start, self.base, self._task, self._origin, self._bounds
        return Fastest, given, {"end": self.end}  # which may be earlier: see `_meet`


class Joiner:
    """Makes the segments that lead from a state to a goal, within the bounds."""

    def __init__(self, bounds: MotionBounds, linear: int) -> None:
        """Set the bounds, and how many coordinates are linear."""
        self.bounds, self._linear = bounds, linear
        self._zero = np.zeros(len(bounds.speed))

    def smooth(self, t: float, state: State, goal: Goal) -> QuinticSegment | None:
        """Return the quintic that reaches a goal in time, if the bounds permit."""
        T = goal.time - t
        if T < SHORTEST:
            return None
        ends = np.stack(
            [
                *(state.x, T * state.rate, T * T * state.acceleration),
                *(goal.x, T * goal.rate, T * T * goal.acceleration),
            ]
        )
        if not self.bounds.keep(ends, T):
            return None
        return QuinticSegment(t, goal.time, state.base, ends)

    def fastest(self, t: float, state: State, goal: Goal) -> Segment:
        """Return the fastest way to a goal, which keeps moving at its velocity.

        A goal at rest is reached at its time, or as soon as the bounds permit. Where
        the goal moves, a position does not wait for an orientation that is behind.
        """
        drift = np.clip(goal.rate, -0.9 * self.bounds.speed, 0.9 * self.bounds.speed)
        origin = goal._replace(rate=drift).at(t)
        moves = bool(drift.any())
        task = FastestTask(
            x=state.x - origin,
            rate=state.rate - drift,
            acceleration=state.acceleration,
            target_rate=self._zero,
            drift=drift,
            positions=True,
            together=self._linear if moves else len(drift),
            duration=0.0 if moves else max(goal.time - t, 0.0),
        )
        return Fastest(t, state.base, task, origin, self.bounds)
