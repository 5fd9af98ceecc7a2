"""Polynomials that join at knots: lines, stops, minimum jerk, splines."""

from abc import abstractmethod
from dataclasses import KW_ONLY
from functools import cached_property
from math import factorial
from typing import Any, ClassVar, Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Matrix, Number, Positive, Tensor, Vector
from hsp_control.engine.plans import PartCall
from hsp_control.trajectories import checks
from hsp_control.trajectories.arc_length import Course
from hsp_control.trajectories.trajectory import Trajectory

# Row k maps (x, x', x'') at u = 0 and (x, x', x'') at u = 1 to the coefficient of u^k.
QUINTIC: Array = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
        [-10.0, -6.0, -1.5, 10.0, -4.0, 0.5],
        [15.0, 8.0, 1.5, -15.0, 7.0, -1.0],
        [-6.0, -3.0, -0.5, 6.0, -3.0, 0.5],
    ]
)
QUINTIC.setflags(write=False)


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


class PolynomialTrajectory(Trajectory):
    """Polynomials that join at knots; a subclass defines them, in `_pieces`.

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

    @property
    def course(self) -> Course:
        """From the first knot to the last."""
        return Course(self.pieces.times, False)

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        return PartCall(engine.PiecewisePolynomial, **self.pieces._asdict())


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


class Line(PolynomialTrajectory, type="line"):
    """x(t) = x0 + s (x1 - x0), with s the `smooth_step` from rest to rest.

    C². It rests at x0 before and at x1 after; the peak speed is 1.875 |x1 - x0| / T.
    For a line of constant speed use `UniformLine`.
    """

    points: ClassVar[tuple[str, ...]] = ("start", "end")

    end: Vector
    """x1, shape (n,) [m, or the task's unit]."""
    duration: Positive
    """T [s]."""
    _: KW_ONLY
    start: Vector | None = None
    """x0, shape (n,) [m, or the task's unit]; where the robot starts by default."""
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return np.size(self.end)

    def _pieces(self) -> Pieces:
        x0 = checks.array(np.asarray(self.start), "start", (None,))
        x1 = checks.array(self.end, "end", x0.shape)
        rest = np.zeros_like(x0)
        coefficients = QUINTIC @ np.stack([x0, rest, rest, x1, rest, rest])
        times = [self.start_time, self.start_time + self.duration]
        return join(times, coefficients[np.newaxis], x1)


class Stops(PolynomialTrajectory, type="stops"):
    """x(t) = x_i + s (x_{i+1} - x_i) from t_i to t_{i+1}, s the `smooth_step`.

    Straight lines with rest at every waypoint, C² everywhere.
    """

    points: ClassVar[tuple[str, ...]] = ("waypoints",)

    waypoints: Matrix
    """At least two points x_i, shape (m, n) [m, or the task's unit]; the same point
    twice is a pause."""
    times: Vector
    """Times t_i of the waypoints, increasing, shape (m,) [s]."""

    def _pieces(self) -> Pieces:
        x = np.asarray(self.waypoints)
        t = checks.waypoint_times(self.times, len(x))
        # (x, x', x'') at the start and at the end of each segment
        ends = np.zeros((len(x) - 1, 6, x.shape[1]))
        ends[:, 0], ends[:, 3] = x[:-1], x[1:]
        return join(t, QUINTIC @ ends, x[-1])


# Third and fourth derivative of Σ c_k u^k at u = 0 and u = 1, as functions of the end
# values of the quintic; the rows of `QUINTIC` give its coefficients.
_START = np.array([6.0 * QUINTIC[3], 24.0 * QUINTIC[4]])
_END = np.array(
    [
        6.0 * QUINTIC[3] + 24.0 * QUINTIC[4] + 60.0 * QUINTIC[5],
        24.0 * QUINTIC[4] + 120.0 * QUINTIC[5],
    ]
)


class MinimumJerk(PolynomialTrajectory, type="minimum_jerk"):
    """min ∫ |x'''|² dt through waypoints, at rest at both ends.

    The motion is a quintic between waypoints, and C⁴ at the inner waypoints. Velocity
    and acceleration are zero at both ends, so that it is C² together with the rest
    before and after. One dense linear system is solved: the unknowns are velocity and
    acceleration at the inner waypoints, the equations continuity of jerk and snap
    there.

    References:
        T. Flash, N. Hogan, "The coordination of arm movements: an experimentally
        confirmed mathematical model", Journal of Neuroscience 5(7), 1985.
    """

    points: ClassVar[tuple[str, ...]] = ("waypoints",)

    waypoints: Matrix
    """At least two points, shape (m, n) [m, or the task's unit]."""
    times: Vector
    """Times of the waypoints, increasing, shape (m,) [s]."""

    def _pieces(self) -> Pieces:
        x = np.asarray(self.waypoints)
        t = checks.waypoint_times(self.times, len(x))
        # states[i] = (x, x', x'') at waypoint i
        states = np.zeros((len(x), 3, x.shape[1]))
        states[:, 0] = x
        states[1:-1, 1:] = _inner_rates(x, np.diff(t))
        scales = np.diff(t)[:, np.newaxis] ** [0, 1, 2, 0, 1, 2]  # d/dt to d/du
        ends = np.concatenate([states[:-1], states[1:]], axis=1)
        return join(t, QUINTIC @ (scales[..., np.newaxis] * ends), x[-1])


def _inner_rates(x: Array, widths: Array) -> Array:
    """Return x' and x'' at the inner waypoints, shape (m - 2, 2, n)."""
    m, n = x.shape
    powers = np.array([0, 1, 2, 0, 1, 2]) - np.array([[3], [4]])  # d/du to d/dt
    # A (x, x', x'' at every waypoint) = 0: jerk and snap before minus those after
    A = np.zeros((m - 2, 2, m, 3))
    for i in range(m - 2):
        for segment, rows, sign in ((i, _END, 1.0), (i + 1, _START, -1.0)):
            block = sign * rows * widths[segment] ** powers
            A[i, :, segment : segment + 2] += block.reshape(2, 2, 3)
    given = np.einsum("rsi,ij->rsj", A[..., 0], x).reshape(2 * (m - 2), n)
    unknown = A[:, :, 1:-1, 1:].reshape(2 * (m - 2), 2 * (m - 2))
    return np.linalg.solve(unknown, -given).reshape(m - 2, 2, n)


class Spline(PolynomialTrajectory, type="spline"):
    """min ∫ |x⁽ᵏ⁾|² dt through waypoints, k = (degree + 1) / 2, at rest at both ends.

    The spline of degree 3 (C²), 5 (C⁴) or 7 (C⁶) has the minimum acceleration, jerk or
    snap; its derivatives 1, 1 to 2 or 1 to 3 are zero at both ends. With degree 3 the
    acceleration therefore jumps at both ends; with 5 and 7 the motion is C² everywhere.
    `MinimumJerk` computes degree 5 without SciPy.
    """

    points: ClassVar[tuple[str, ...]] = ("waypoints",)

    waypoints: Matrix
    """At least two points, shape (m, n) [m, or the task's unit]."""
    times: Vector
    """Times of the waypoints, increasing, shape (m,) [s]."""
    degree: Literal[3, 5, 7] = 5
    """Degree of the polynomials [-]."""

    def _pieces(self) -> Pieces:
        # This import takes 0.2 s, so only splines make it.
        from scipy.interpolate import make_interp_spline

        x, degree = np.asarray(self.waypoints), self.degree
        t = checks.waypoint_times(self.times, len(x))
        rest: Any = [(k, np.zeros(x.shape[1])) for k in range(1, (degree + 1) // 2)]
        spline = make_interp_spline(t, x, k=degree, bc_type=(rest, rest))
        widths = np.diff(t)[:, np.newaxis]
        taylor = [  # in u, from the left end of each segment
            spline(t[:-1], nu=k) * widths**k / factorial(k)
            for k in range(1, degree + 1)
        ]
        return join(t, np.stack([x[:-1], *taylor], axis=1), x[-1])
