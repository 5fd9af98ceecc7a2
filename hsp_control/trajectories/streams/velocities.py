"""Pieces that reach a commanded velocity and keep it: a joystick's, or a joint jog's.

A velocity changes along a cubic, so that all its components keep their ratio from one
steady velocity to another: a hand leaves its straight line or its screw for no moment.
Where no cubic keeps the bounds, what still accelerates is brought to a steady velocity
first; in world axes, at last, Ruckig finds a way.

In world axes the coordinates are those of `Chart`. In the tool's axes the linear ones
are u with x' = R u instead, and x is the integral of R u: exact where the twist is
constant (a screw), and else by polynomials to rounding error.
"""

from math import ceil, sqrt
from typing import Literal, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.engine.rotations import exp3, jexp3, jexp3_dot, jlog3
from hsp_control.trajectories.orientation import OrientationSample
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.segments import (
    DERIVATIVES,
    PLANNED,
    SAME,
    SHORTEST,
    Coast,
    Fastest,
    FastestTask,
    MotionBounds,
    QuinticSegment,
    Segment,
)

Axes = Literal["world", "tool"]
"""The axes in which a velocity is commanded: the world's, or the moving body's."""


class Command(NamedTuple):
    """A velocity to reach and to keep."""

    velocity: Array  # linear, then angular, (n,) [1/s]
    axes: Axes

    def same(self, other: "Command | None") -> bool:
        """Return whether another command says the same."""
        return (
            other is not None
            and self.axes == other.axes
            and np.array_equal(self.velocity, other.velocity)
        )


class Velocities:
    """Makes the pieces that reach a velocity, or keep it, within the bounds."""

    def __init__(self, chart: Chart, bounds: MotionBounds) -> None:
        """Set the coordinates, and the bounds in them."""
        self._chart, self._bounds = chart, bounds
        # The bounds on a rotation vector hold for its length in truth; see
        # `angular_bounds`, which makes a box of them for Ruckig.
        self._ball = [sqrt(3.0) * float(each[-1]) for each in bounds]

    def follow(self, t: float, state: State, command: Command, delay: float) -> Segment:
        """Return what reaches a velocity, in ``delay`` [s] if the bounds permit.

        The state is at the base of its chart. A velocity beyond the bounds keeps its
        direction. A piece that keeps the velocity has no end.
        """
        n, tool = self._chart.linear, command.axes == "tool"
        wanted = self._within(command.velocity)
        seen = _in_tool_axes(state, n) if tool else state
        there = wanted.copy()
        if self._chart.rotational and not tool:
            there[n:] = state.base.T @ wanted[n:]
        apart = np.abs(there - seen.rate).max()
        if apart < SAME and np.abs(seen.acceleration).max() < SAME:
            if not wanted.any():
                return Coast(t, np.inf, State(state.x, there, there, state.base))
            coast = Coast(t, np.inf, seen)
            return ToolCoast(coast, state, self._chart) if tool and n else coast
        T = self._shortest(there - seen.rate, delay)
        for _ in range(_TRIES):
            ends = self._change(seen, there, command.axes, T)
            if kept := self._keeps(ends, T):
                break
            T *= _LONGER
        else:  # the acceleration must end first, as the stick was turned back
            T = self._shortest_end(seen.acceleration)
            there = seen.rate + T / 3.0 * seen.acceleration
            ends = self._change(seen, there, command.axes, T)
            kept = self._keeps(ends, T)
        if not (kept or tool):
            return self._fastest(t, state, wanted)
        quintic = QuinticSegment(t, t + T, state.base, ends)
        return ToolChange(quintic, state, self._chart) if tool and n else quintic

    def _within(self, velocity: Array) -> Array:
        """Return a velocity in its own direction, but not beyond the bounds."""
        n, wanted = self._chart.linear, velocity.astype(float)
        if n:
            wanted[:n] /= max(1.0, float((np.abs(wanted[:n]) / self._speed).max()))
        if self._chart.rotational:
            wanted[n:] /= max(1.0, float(np.linalg.norm(wanted[n:])) / self._ball[0])
        return wanted

    @property
    def _speed(self) -> Array:
        return self._bounds.speed[: self._chart.linear]

    def _shortest(self, change: Array, delay: float) -> float:
        """Return how long a change of velocity takes from one steady one to another.

        A cubic's largest acceleration is 1.5 Δ/T, its largest jerk 6 Δ/T².
        """
        T = max(delay, SHORTEST, 1.5 * self._share(change, 1))
        T = max(T, sqrt(6.0 * self._share(change, 2)))
        return T * (1.0 + 1e-9)  # else rounding decides

    def _shortest_end(self, acceleration: Array) -> float:
        """Return how long an acceleration takes to end, as a parabola: 2 a/T is jerk.

        The velocity that is reached by then lies T/3 a farther, a third more than with
        a constant jerk.
        """
        T = max(SHORTEST, 2.0 * self._share(acceleration, 2))
        return T * (1.0 + 1e-9)

    def _share(self, change: Array, k: int) -> float:
        """Return the largest ratio of a change to a bound: 1 acceleration, 2 jerk."""
        n = self._chart.linear
        linear = float((np.abs(change[:n]) / self._bounds[k][:n]).max(initial=0.0))
        if not self._chart.rotational:
            return linear
        return max(linear, float(np.linalg.norm(change[n:]) / self._ball[k]))

    def _change(self, state: State, rate: Array, axes: Axes, T: float) -> Array:
        """Return the ends of a quintic whose velocity is a cubic, shape (6, n).

        At its end the velocity is steady in its axes. How a rotation vector must move
        for that depends on where it is then, which depends on how it moves: see
        `_steady`, which repeats what it finds until that stays.
        """
        moved = 0.5 * T * state.rate
        moved += state.x + T * T / 12.0 * state.acceleration
        x, still = moved + 0.5 * T * rate, np.zeros_like(rate)
        found = x, rate, still
        if self._chart.rotational:
            found = self._steady(moved, rate, axes, T) or found
        x, rate, acceleration = found
        return np.stack(
            [
                *(state.x, T * state.rate, T * T * state.acceleration),
                *(x, T * rate, T * T * acceleration),
            ]
        )

    def _steady(
        self, moved: Array, wanted: Array, axes: Axes, T: float
    ) -> tuple[Array, Array, Array] | None:
        """Return x, x' and x'' in which the angular velocity is as wanted, and steady.

        None: not found, as it turns far until then. Then the next piece corrects what
        is left, which is less.
        """
        n, rate, acceleration = self._chart.linear, wanted.copy(), np.zeros_like(wanted)
        x = moved + 0.5 * T * rate
        for _ in range(_REPEATED):
            y = x[n:]
            if y @ y > _FAR * _FAR:
                return None
            inverse = jlog3(y)
            turned = np.eye(3) if axes == "tool" else exp3(y).T
            rate[n:] = inverse @ turned @ wanted[n:]
            acceleration[n:] = -inverse @ jexp3_dot(y, rate[n:]) @ rate[n:]
            before, x = x, moved + 0.5 * T * rate - T * T / 12.0 * acceleration
            if np.abs(x - before).max() < 1e-15:
                return x, rate, acceleration
        return None

    def _keeps(self, ends: Array, T: float) -> bool:
        """Return whether such a quintic keeps the bounds throughout.

        See `MotionBounds.keep`; the angular ones hold for lengths here. What is too
        fast at the start, as a body may be in other axes than those of before, may be
        so until it is slower.
        """
        n, scale = self._chart.linear, 1.0
        for k, (matrix, bound) in enumerate(
            zip(DERIVATIVES, self._bounds, strict=True)
        ):
            scale *= T
            points = matrix @ ends / scale
            sizes, most = np.abs(points[:, :n]), bound[:n]
            if self._chart.rotational:
                length = np.linalg.norm(points[:, n:], axis=1)
                ball = self._ball[k] / (PLANNED if k == 0 else 1.0)
                sizes = np.column_stack([sizes, length])
                most = np.append(most, ball)
            if k < 2:
                most = np.maximum(most, sizes[0])
            if (sizes > most * (1.0 + 1e-12)).any():
                return False
        return True

    def _fastest(self, t: float, state: State, rate: Array) -> Segment:
        """Return Ruckig's fastest way to a velocity in world axes."""
        n, still = self._chart.linear, np.zeros_like(rate)
        rate = np.concatenate([rate[:n], rate[n:] @ state.base[: len(rate) - n]])
        task = FastestTask(
            x=state.x,
            rate=state.rate,
            acceleration=state.acceleration,
            target_rate=rate,
            drift=still,
            positions=False,
            together=len(rate),
            duration=0.0,
        )
        return Fastest(t, state.base, task, still, self._bounds)


_TRIES, _LONGER = 8, 1.25
"""How often a longer cubic is tried, and how much longer: up to five times."""
_REPEATED = 40  # a change that turns by a radian needs some fifteen
_FAR = 2.0  # a change that turns by more is not made steady at its end [rad]


def _in_tool_axes(state: State, n: int) -> State:
    """Return a state at the base of its chart with u and u' in place of x' and x''.

    x' = R u, x'' = R (u' + ω × u), with ω in the body's axes.
    """
    if not n:
        return state
    rate, acceleration = state.rate.copy(), state.acceleration.copy()
    rate[:n] = u = state.base.T @ rate[:n]
    acceleration[:n] = state.base.T @ acceleration[:n] - _cross(rate[n:], u)
    return State(state.x, rate, acceleration, state.base)


def _cross(a: Array, b: Array) -> Array:
    """Return a × b: `np.cross` takes ten times as long for two vectors."""
    (a1, a2, a3), (b1, b2, b3) = a.tolist(), b.tolist()
    return np.array([a2 * b3 - a3 * b2, a3 * b1 - a1 * b3, a1 * b2 - a2 * b1])


class ToolMotion(Segment):
    """A piece in which x' = R u: u and a rotation vector are those of another piece."""

    def __init__(self, inner: Segment, state: State, chart: Chart) -> None:
        """Begin in a state; ``inner`` moves what u is the rate of, from there on."""
        super().__init__(inner.start, inner.end, state.base)
        self._inner, self._chart = inner, chart
        self._begin = state.x[:3].copy()

    def state(self, t: float) -> State:
        """Return the state at time t [s]."""
        found, turned = self._inner.state(t), OrientationSample.allocate()
        self._chart.write_orientation(found, turned)
        R, omega, _ = turned
        found.x[:3] = self._at(t)
        found.rate[:3] = velocity = R @ found.rate[:3]
        found.acceleration[:3] = R @ found.acceleration[:3] + _cross(omega, velocity)
        return found

    def _at(self, t: float) -> Array:
        """Return x at time t, the integral of R u."""
        raise NotImplementedError


class ToolCoast(ToolMotion):
    """A constant twist in the tool's axes: the body moves along a screw."""

    def _at(self, t: float) -> Array:
        start = self._inner.state(self.start)
        elapsed, u, omega = t - self.start, start.rate[:3], start.rate[3:]
        moved = elapsed * jexp3(-elapsed * omega) @ u  # ∫ exp(s ω) ds u
        return np.asarray(self._begin + self.base @ moved)


class ToolChange(ToolMotion):
    """A twist that changes in the tool's axes, for a short time.

    R u is a polynomial between Chebyshev's points of each panel, and x is its integral.
    """

    def __init__(self, inner: Segment, state: State, chart: Chart) -> None:
        """Integrate the velocity over all of the piece."""
        super().__init__(inner, state, chart)
        ends = inner.state(inner.start).rate[3:], inner.state(inner.end).rate[3:]
        fastest = max(map(np.linalg.norm, ends))
        panels = ceil(fastest * (inner.end - inner.start) / _TURN) or 1
        self._width = (inner.end - inner.start) / panels
        self._begins, self._integrals = [self._begin], []
        for k in range(panels):
            middle = self.start + (k + 0.5) * self._width
            times = middle + 0.5 * self._width * _POINTS
            velocities = np.array([self._velocity(t) for t in times])
            self._integrals.append(0.5 * self._width * _INTEGRAL @ velocities)
            self._begins.append(self._begins[-1] + self._integrals[-1].sum(axis=0))

    def _velocity(self, t: float) -> Array:
        found, turned = self._inner.state(t), OrientationSample.allocate()
        self._chart.write_orientation(found, turned)
        return np.asarray(turned.rotation @ found.rate[:3])

    def _at(self, t: float) -> Array:
        passed = (t - self.start) / self._width
        k = min(int(passed), len(self._integrals) - 1)
        powers = (2.0 * (passed - k) - 1.0) ** _POWERS
        return np.asarray(self._begins[k] + powers @ self._integrals[k])


_TURN = 0.2
"""In no panel does the body turn farther [rad]: x is off is off by 1e-12 of the way."""
_DEGREE = 11
_POINTS = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
_POWERS = np.arange(_DEGREE + 2)


def _integral() -> Array:
    """Return what maps values at the points to the integral's coefficients from -1.

    Shape (degree + 2, degree + 1); the coefficients are of powers of a time in [-1, 1].
    """
    coefficients = np.linalg.inv(np.vander(_POINTS, increasing=True))
    found = np.zeros((_DEGREE + 2, _DEGREE + 1))
    found[1:] = coefficients / np.arange(1, _DEGREE + 2)[:, None]
    found[0] = -((-1.0) ** _POWERS[1:]) @ found[1:]
    return found


_INTEGRAL = _integral()
