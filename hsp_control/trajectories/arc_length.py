"""The length along a path, as a table, and the speed at which it may be followed."""

from collections.abc import Callable, Iterator
from itertools import pairwise
from math import inf, isinf, pi, sqrt
from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError

Rates = Callable[[float], tuple[Array, Array]]
"""Rates from which a path's length is computed: y = dp/du and dy/du at a parameter
u."""


class Course(NamedTuple):
    """The interval of times in which a motion traverses its path."""

    knots: Array  # its start, the joints of smooth pieces, and its end, (m,)
    repeats: bool  # whether it is periodic: a circle

    @classmethod
    def turn(cls, rate: float) -> Self:
        """Return one period of a periodic motion with a rate [rad/s]."""
        return cls(np.array([0.0, 2.0 * pi / abs(rate) if rate else 1.0]), True)


class ArcLength(NamedTuple):
    """s(u): a polynomial in each cell from one knot to the next; see the engine's.

    Its rate is |dp/du| up to 1e-13 of the largest |dp/du|. The rates of a motion that
    follows the path are computed from p itself, and agree with the motion to that
    accuracy.
    """

    knots: Array  # u, increasing, (m,)
    lengths: Array  # s at the knots, (m,)
    coefficients: Array  # of w = -1 to 1 in each cell, (m - 1, NODES + 1)
    repeats: bool


class Path(NamedTuple):
    """The length along a path, and its curvature at closely spaced points."""

    arc: ArcLength
    places: Array  # s of these points, (k,)
    curvatures: Array  # |d²p/ds²| there, (k,)

    @property
    def length(self) -> float:
        """Length of the path; infinite if it is endless."""
        return inf if self.arc.repeats else float(self.arc.lengths[-1])


class TimeScaling(NamedTuple):
    """s(t): see the engine's."""

    start_time: float
    speed: float  # the largest reached speed
    ramp: float  # duration of the rise and of the fall [s]
    length: float


# --- the length -----------------------------------------------------------------------

# In each cell |dp/du| is a polynomial through nodes, and compared between them.
NODES = 12
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(NODES)
_BETWEEN = np.array([-1.0, *(_NODES[1:] + _NODES[:-1]) / 2, 1.0]) * (1.0 - 1e-9)
_AT_BETWEEN = np.vander(_BETWEEN, NODES, increasing=True)
_POINTS = np.concatenate([_NODES, _BETWEEN])
_ORDER = np.argsort(_POINTS)
# From values at the nodes to Legendre's polynomials, and from these to powers of w.
_LEGENDRE = np.polynomial.legendre.legvander(_NODES, NODES - 1)
_TO_POWERS = np.array(
    [
        np.pad(np.polynomial.legendre.leg2poly(row), (0, NODES - 1 - k))
        for k, row in enumerate(np.eye(NODES))
    ]
)
_TO_LEGENDRE = (np.arange(NODES) + 0.5)[:, np.newaxis] * _LEGENDRE.T * _WEIGHTS
_ROUNDING = 2e-15  # share of the largest coefficient that is rounding error

_EXACT = 1e-13  # relative error of |dp/du| below which no cell is divided
_NOISE = 1e-8  # above it a cell is not divided if that does not help
_DEPTH = 12  # a piece is divided into 2^12 cells at most
_TURN = 0.99  # cosine of the angle between neighbours: the path turns by 8° at most
_REST = (
    1e-9  # share of the largest |dp/du| below which the path's own motion is at rest
)


class _Cell(NamedTuple):
    start: float
    end: float
    coefficients: Array  # of s, (NODES + 1,)
    places: Array  # s at `_POINTS` in order, from the start of the cell
    curvatures: Array
    tangents: Array  # the first and the last one, (2, n)


def measured(rates: Rates, course: Course) -> Path:
    """Return the length along a path.

    Raises:
        TrajectoryError: If nothing moves, or if the path has a place that can only be
        passed at rest: a corner, or a point at which its own motion stops.
    """
    knots = course.knots
    largest = max(
        float(np.linalg.norm(rates(u)[0]))
        for a, b in pairwise(knots)
        for u in _inside(a, b, _POINTS)
    )
    if not largest > 0.0:
        raise TrajectoryError("the path has no length: nothing moves along it")
    found: list[_Cell] = []
    for a, b in pairwise(knots):
        length = sum(cell.coefficients.sum() for cell in found)
        if found:
            _check_joint(rates, a, min(b - a, a - found[-1].start), largest, length)
        found += _cells(rates, a, b, largest, length)
    coefficients = np.array([cell.coefficients for cell in found])
    lengths = np.concatenate([[0.0], np.cumsum(coefficients.sum(axis=1))])
    for i in range(0 if course.repeats else 1, len(found)):
        if found[i].tangents[0] @ found[i - 1].tangents[1] < _TURN:
            raise _corner(lengths[i], found[i].start)
    return Path(
        ArcLength(
            np.array([*(cell.start for cell in found), found[-1].end]),
            lengths,
            coefficients,
            course.repeats,
        ),
        np.concatenate([s + c.places for s, c in zip(lengths, found, strict=False)]),
        np.concatenate([cell.curvatures for cell in found]),
    )


def _inside(a: float, b: float, points: Array) -> Array:
    return np.asarray(0.5 * ((1.0 - points) * a + (1.0 + points) * b))


def _check_joint(
    rates: Rates, u: float, width: float, largest: float, s: float
) -> None:
    """Refuse a knot at which the path's own motion stops, or has a corner."""
    before, after = (rates(u + k * 1e-9 * width)[0] for k in (-1, 1))
    lengths = [float(np.linalg.norm(each)) for each in (before, after)]
    if min(lengths) <= _REST * largest:
        raise _rest(s, u)
    cosine = float(before @ after) / (lengths[0] * lengths[1])
    if cosine < 1.0 - 1e-9:
        raise _corner(s, u)


def _rest(s: float, u: float) -> TrajectoryError:
    return TrajectoryError(
        f"at s = {s:.3f} along the path its own motion stops (at {u:.4g} s): it can "
        "only be passed at rest; give a path that does not stop there"
    )


def _corner(s: float, u: float) -> TrajectoryError:
    return TrajectoryError(
        f"at s = {s:.3f} along the path (its own time is {u:.4g} s) it has a corner "
        "or turns back: it can only be passed at rest; round it, or end the path "
        "there"
    )


def _cells(
    rates: Rates, start: float, end: float, largest: float, length: float
) -> Iterator[_Cell]:
    """Yield the cells of one piece, in order; ``length``: of the path before it.

    A cell is halved until a polynomial fits |dp/du|, and until the direction changes
    little between neighbouring points.
    """
    waiting = [(start, end, 0, inf)]
    while waiting:
        a, b, depth, error_before = waiting.pop()
        samples = [rates(u) for u in _inside(a, b, _POINTS)]
        y, y_u = (np.array([sample[i] for sample in samples]) for i in (0, 1))
        g = np.linalg.norm(y, axis=1)
        c, error = _fitted(g, largest)
        fits = error <= _EXACT or _NOISE > error > error_before / 4.0

        y, y_u, g = y[_ORDER], y_u[_ORDER], g[_ORDER]
        moves = g > _REST * largest
        if not moves.any():
            raise _rest(length, a)
        g[~moves] = inf  # no direction, and no curvature
        tangent = y / g[:, np.newaxis]
        turns = np.einsum("ij,ij->i", tangent[moves][1:], tangent[moves][:-1])
        smooth = bool((turns > _TURN).all())
        if not (fits and smooth) and depth < _DEPTH:
            middle = 0.5 * (a + b)
            waiting += [(middle, b, depth + 1, error), (a, middle, depth + 1, error)]
            continue
        if not smooth:
            raise _corner(length, 0.5 * (a + b))

        s = np.zeros(NODES + 1)  # the integral of c, from 0 at w = -1
        s[1:] = 0.5 * (b - a) * c / np.arange(1, NODES + 1)
        s[0] = -np.polyval(s[::-1], -1.0)
        across = y_u - np.einsum("ij,ij->i", tangent, y_u)[:, np.newaxis] * tangent
        yield _Cell(
            a,
            b,
            s,
            np.polyval(s[::-1], _POINTS[_ORDER]),
            np.linalg.norm(across, axis=1) / g**2,
            tangent[moves][[0, -1]],
        )
        length += float(s.sum())


def _fitted(g: Array, largest: float) -> tuple[Array, float]:
    """Return the powers of a polynomial through |dp/du| at the nodes, and its error.

    The error is that between the nodes, as a share of the largest |dp/du|.
    """
    c = _TO_LEGENDRE @ g[:NODES]
    c[np.abs(c) < _ROUNDING * largest] = 0.0  # as powers they would lose digits
    c = c @ _TO_POWERS
    return c, float(np.abs(_AT_BETWEEN @ c - g[NODES:]).max()) / largest


# --- the speed ------------------------------------------------------------------------


def time_scaling(
    path: Path, speed: float, acceleration: float | None, start_time: float
) -> TimeScaling:
    """Return s(t) with a largest speed, and from rest to rest if it accelerates.

    Raises:
        TrajectoryError: If the path bends so much that the speed needs more than the
            acceleration across it.
    """
    scaling = _scaling(path.length, speed, acceleration, start_time)
    if acceleration is None:
        return scaling
    needed = path.curvatures * _speeds(scaling, path.places) ** 2
    worst = int(
        np.argmax(needed >= needed.max() * (1.0 - 1e-9))
    )  # the first of equal ones
    if needed[worst] <= acceleration * (1.0 + 1e-9):
        return scaling
    raise TrajectoryError(
        f"at s = {path.places[worst]:.3f} along the path, which bends there with a "
        f"radius of {1.0 / path.curvatures[worst]:.3g}, a speed of "
        f"{_speeds(scaling, path.places)[worst]:.3g} needs an acceleration of "
        f"{needed[worst]:.3g} across it; acceleration = {acceleration:g}. "
        f"speed = {_feasible(path, speed, acceleration):.3g} would do"
    )


def _scaling(
    length: float, speed: float, acceleration: float | None, start_time: float
) -> TimeScaling:
    """Both ramps cover v T, with T = 1.5 v/a; on a short path v is lower."""
    if acceleration is None:
        return TimeScaling(start_time, speed, 0.0, length)
    speed = min(speed, sqrt(acceleration * length / 1.5))
    return TimeScaling(start_time, speed, 1.5 * speed / acceleration, length)


def _speeds(scaling: TimeScaling, places: Array) -> Array:
    """Return s' at lengths s, shape (k,)."""
    if scaling.ramp == 0.0 or isinf(scaling.length):  # every place is passed eventually
        return np.full(len(places), scaling.speed)
    # s = v T u³ (1 - u/2) on a ramp, by bisection
    ahead = np.minimum(places, scaling.length - places)
    shares = np.clip(ahead / (scaling.speed * scaling.ramp), 0.0, 0.5)
    low, high = np.zeros(len(places)), np.ones(len(places))
    for _ in range(60):
        u = 0.5 * (low + high)
        above = u**3 * (1.0 - 0.5 * u) > shares
        low, high = np.where(above, low, u), np.where(above, u, high)
    return np.asarray(scaling.speed * high**2 * (3.0 - 2.0 * high))


def _feasible(path: Path, speed: float, acceleration: float) -> float:
    """Return a speed permitted by the path's bends, with three digits."""
    for _ in range(100):
        scaling = _scaling(path.length, speed, acceleration, 0.0)
        needed = path.curvatures * _speeds(scaling, path.places) ** 2
        excess = float(needed.max()) / acceleration
        if excess <= 1.0:
            break
        speed = min(speed, scaling.speed) / sqrt(excess)
        digit = 10.0 ** (np.floor(np.log10(speed)) - 2.0)
        speed = float(np.floor(speed / digit) * digit)
    return speed
