"""Bounds on speed, acceleration and jerk, and whether a quintic keeps them."""

from itertools import pairwise
from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError

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
        for matrix, bound in zip(_DERIVATIVES, self, strict=True):
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
    planned = 0.95 * speed, curved, turned
    return MotionBounds(*(np.full(3, each / sqrt(3.0)) for each in planned))


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


_DERIVATIVES = _derivatives()
