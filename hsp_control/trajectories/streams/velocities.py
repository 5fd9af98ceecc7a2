"""Pieces that reach a commanded velocity and keep it: a joystick's, or a joint jog's.

A velocity changes along a cubic, so that all its components keep their ratio from one
steady velocity to another: a hand never leaves its straight line or its screw. If no
cubic keeps the bounds, an accelerating motion is first brought to a steady velocity;
finally, in world axes, Ruckig plans the motion.

In world axes the coordinates are those of `Chart`. In the tool's axes the linear ones
are u with x' = R u instead, and x is the integral of R u: exact for a constant twist (a
screw), and otherwise by polynomials to rounding error.
"""

from math import ceil
from typing import Literal, NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.engine.rotations import cross3, jexp3
from hsp_control.trajectories.orientation import OrientationSample
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.segments import (
    COAST,
    MotionBounds,
    Piece,
    Segment,
    found_motion,
    room,
)

Axes = Literal["world", "tool"]
"""The axes in which a velocity is commanded: the world's, or the moving body's."""


class VelocityCommand(NamedTuple):
    """A velocity to reach and to keep."""

    velocity: Array  # linear, then angular, (n,) [1/s]
    axes: Axes

    def same(self, other: "VelocityCommand | None") -> bool:
        """Return whether another command is the same."""
        return (
            other is not None
            and self.axes == other.axes
            and np.array_equal(self.velocity, other.velocity)
        )


class Velocities:
    """Plans the pieces that reach a velocity, or keep it, within the bounds."""

    def __init__(self, chart: Chart, bounds: MotionBounds) -> None:
        """Set the coordinates, and the bounds in them."""
        self._chart, self._bounds = chart, bounds

    def follow(
        self, t: float, state: State, command: VelocityCommand, delay: float
    ) -> Segment:
        """Return a piece that reaches a velocity, if possible in ``delay`` [s].

        The state is at the base of its chart. A velocity beyond the bounds keeps its
        direction. A piece that keeps the velocity has no end.

        Raises:
            StreamError: If no motion within the bounds is found.
        """
        numbers = room(self._chart.size)
        planned = engine.VelocityPiece(
            t=float(t),
            linear=self._chart.linear,
            tool=float(command.axes == "tool"),
            delay=delay,
            bounds=self._bounds,
            state=vars(state),
            velocity=command.velocity.astype(float),
            piece=numbers,
        )()
        piece = found_motion(Piece(numbers, state.base) if planned else None)
        if planned != _IN_TOOL_AXES:
            return piece
        kind = ToolCoast if numbers[0] == COAST else ToolChange
        return kind(piece, state, self._chart)


_IN_TOOL_AXES = 2.0
"""The engine's record of a piece in which x is the integral of u."""


class ToolMotion(Segment):
    """A piece in which x' = R u: u and a rotation vector are those of another piece."""

    def __init__(self, inner: Segment, state: State, chart: Chart) -> None:
        """Begin in a state; u is the rate of ``inner``, from there on."""
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
        found.acceleration[:3] = R @ found.acceleration[:3] + cross3(omega, velocity)
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
"""Maximum rotation of the body in a panel [rad]: the error of x is 1e-12 of the
path."""
_DEGREE = 11
_POINTS = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))
_POWERS = np.arange(_DEGREE + 2)


def _integral() -> Array:
    """Return the matrix from values at the points to the integral's coefficients.

    Shape (degree + 2, degree + 1); the coefficients are of powers of a time in [-1, 1].
    """
    coefficients = np.linalg.inv(np.vander(_POINTS, increasing=True))
    found = np.zeros((_DEGREE + 2, _DEGREE + 1))
    found[1:] = coefficients / np.arange(1, _DEGREE + 2)[:, None]
    found[0] = -((-1.0) ** _POWERS[1:]) @ found[1:]
    return found


_INTEGRAL = _integral()
