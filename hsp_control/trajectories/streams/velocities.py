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

from hsp_control.common.arrays import Array
from hsp_control.engine.rotations import cross3, jexp3
from hsp_control.trajectories.streams.piece_calls import COAST, PieceCalls, base_of
from hsp_control.trajectories.streams.segments import Piece, Segment

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


def velocity_piece(
    t: float, command: VelocityCommand, calls: PieceCalls
) -> Segment | None:
    """Return the segment that reaches a velocity from ``calls.state`` at a time [s].

    None: no motion within the bounds is found. See `PieceCalls.follow`.
    """
    numbers, as_integral = calls.follow(
        t, command.velocity, tool=command.axes == "tool"
    )
    if numbers is None:
        return None
    if not as_integral:
        return Piece(numbers)
    kind = ToolCoast if numbers[0] == COAST else ToolChange
    return kind(Piece(numbers), calls)


class ToolMotion(Segment):
    """A piece in which x' = R u: u and a rotation vector are those of another piece."""

    def __init__(self, inner: Piece, calls: PieceCalls) -> None:
        """Begin in ``calls.state``; ``inner`` moves the integral of u."""
        super().__init__(inner.start, inner.end)
        self._inner, self._begin = inner, calls.state.x[:3].copy()

    def write(self, t: float, calls: PieceCalls) -> None:
        """Write the state at time t [s]; see `Segment.write`."""
        state = calls.state
        self._inner.write(t, calls)
        calls.turn()
        R, omega, _ = calls.turned
        state.rate[:3] = velocity = R @ state.rate[:3]
        state.acceleration[:3] = R @ state.acceleration[:3] + cross3(omega, velocity)
        state.x[:3] = self._at(t)

    def _at(self, t: float) -> Array:
        """Return x at time t, the integral of R u."""
        raise NotImplementedError


class ToolCoast(ToolMotion):
    """A constant twist in the tool's axes: the body moves along a screw."""

    def __init__(self, inner: Piece, calls: PieceCalls) -> None:
        """Keep the twist, which is that of all of the piece."""
        super().__init__(inner, calls)
        inner.write(inner.start, calls)
        self._twist = calls.state.rate.copy()

    def _at(self, t: float) -> Array:
        elapsed, u, omega = t - self.start, self._twist[:3], self._twist[3:]
        moved = elapsed * jexp3(-elapsed * omega) @ u  # ∫ exp(s ω) ds u
        return np.asarray(self._begin + base_of(self._inner.numbers) @ moved)


class ToolChange(ToolMotion):
    """A twist that changes in the tool's axes, for a short time.

    R u is a polynomial between Chebyshev's points of each panel, and x is its integral.
    """

    def __init__(self, inner: Piece, calls: PieceCalls) -> None:
        """Integrate the velocity over all of the piece."""
        super().__init__(inner, calls)
        fastest = 0.0
        for end in (inner.start, inner.end):
            inner.write(end, calls)
            fastest = max(fastest, float(np.linalg.norm(calls.state.rate[3:])))
        panels = ceil(fastest * (inner.end - inner.start) / _TURN) or 1
        self._width = (inner.end - inner.start) / panels
        self._begins, self._integrals = [self._begin], []
        for k in range(panels):
            middle = self.start + (k + 0.5) * self._width
            times = middle + 0.5 * self._width * _POINTS
            velocities = np.array([self._velocity(t, calls) for t in times.tolist()])
            self._integrals.append(0.5 * self._width * _INTEGRAL @ velocities)
            self._begins.append(self._begins[-1] + self._integrals[-1].sum(axis=0))

    def _velocity(self, t: float, calls: PieceCalls) -> Array:
        self._inner.write(t, calls)
        calls.turn()
        return np.asarray(calls.turned.rotation @ calls.state.rate[:3])

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
