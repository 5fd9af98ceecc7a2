"""Polynomials that join at knots."""

from abc import abstractmethod
from dataclasses import KW_ONLY
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.declaration.quantities import Tensor, Vector
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.polynomial import horner
from hsp_control.trajectories.trajectory import Trajectory


class Pieces(NamedTuple):
    """x(t) = Σ_k c_ik u^k, u = (t - t_i) / (t_{i+1} - t_i) from t_i to t_{i+1}."""

    times: Array  # the m knots, increasing, (m,) [s]
    waypoints: Array  # the points at the knots, (m, n)
    coefficients: Array  # c, (m - 1, degree + 1, n)


def join(times: ArrayLike, coefficients: ArrayLike, end: ArrayLike | None) -> Pieces:
    """Return polynomials joined at their knots, checked.

    Shapes: times (m,) [s], coefficients (m - 1, degree + 1, n), end (n,).
    """
    c = checks.array(coefficients, "coefficients", (None, None, None))
    knots = checks.waypoint_times(times, len(c) + 1)
    last = c[-1].sum(axis=0) if end is None else end
    last = checks.array(last, "end", c.shape[2:])
    return Pieces(knots, np.vstack([c[:, 0], last]), c)


class PolynomialTrajectory(Compiled, Trajectory):
    """Polynomials that join at knots; a subclass says which, in `_pieces`.

    The motion rests exactly at the first point before the first knot, and at the last
    point after the last knot. The coefficients decide how smooth it is at the knots.
    """

    @abstractmethod
    def _pieces(self) -> Pieces:
        """Return the polynomials; called once, when no point is missing."""

    @cached_property
    def pieces(self) -> Pieces:
        """The polynomials."""
        return self._pieces()

    def __post_init__(self) -> None:
        """Compute the polynomials, which checks the arguments."""
        if all(getattr(self, name) is not None for name in self.points):
            self.pieces  # noqa: B018 (computed, and kept)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return len(self.pieces.waypoints[0])

    def _kernel(self) -> Kernel:
        return _evaluate, tuple(self.pieces)


class PiecewisePolynomial(PolynomialTrajectory):
    """x(t) = Σ_k c_ik u^k, u = (t - t_i) / (t_{i+1} - t_i), from t_i to t_{i+1}."""

    times: Vector
    """The m knots, increasing, shape (m,) [s]."""
    coefficients: Tensor
    """c, shape (m - 1, degree + 1, n) [m, or the task's unit]."""
    _: KW_ONLY
    end: Vector | None = None
    """The point after the last knot, shape (n,) [m, or the task's unit]; the end of the
    last polynomial by default, with its rounding error."""

    def _pieces(self) -> Pieces:
        return join(self.times, self.coefficients, self.end)


@kernel
def _evaluate(
    times: Array,
    waypoints: Array,
    coefficients: Array,
    position: Array,
    velocity: Array,
    acceleration: Array,
    t: float,
) -> None:
    last = times.size - 1
    if t <= times[0] or t >= times[last]:
        end = 0 if t <= times[0] else last
        for j in range(position.size):
            position[j] = waypoints[end, j]
            velocity[j] = 0.0
            acceleration[j] = 0.0
        return
    i, after = 0, last  # bisection for times[i] <= t < times[i + 1]
    while after - i > 1:
        middle = (i + after) // 2
        if t < times[middle]:
            after = middle
        else:
            i = middle
    width = times[i + 1] - times[i]
    u = (t - times[i]) / width
    horner(u, width, coefficients[i], position, velocity, acceleration)
