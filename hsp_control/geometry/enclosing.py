"""Convex hulls and capsules that enclose points, meshes and ellipsoids."""

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array


def convex_hull(mesh: Any) -> Any:
    """Return the hull of one of Coal's meshes; None if it is flat: Coal would abort."""
    from scipy.spatial import ConvexHull, QhullError  # here: importing SciPy is slow

    try:
        ConvexHull(np.array(mesh.vertices()), qhull_options="Qt")
    except QhullError:
        return None
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


def hull_corners(points: Array) -> Array:
    """Return the points (k, 3) that are vertices of the hull; all if it is flat."""
    from scipy.spatial import ConvexHull, QhullError  # here: importing SciPy is slow

    try:
        return points[ConvexHull(points, qhull_options="QJ").vertices]
    except QhullError:
        return points


def enclosing_capsule(points: Array) -> tuple[Array, Array, float]:
    """Return the ends (3,) and the radius [m] of a small capsule around points (k, 3).

    The direction and the offset of its axis minimise the volume, by a local search from
    each of the three principal axes. For a given axis the segment is the shortest; the
    ends of a sphere are equal. It is remembered: a robot is often loaded again.
    """
    ends, radius = _enclosing(np.asarray(points, dtype=float).tobytes())
    return *np.array(ends), radius


@lru_cache(maxsize=512)  # of 40 robots; a kilobyte to 40 a shape
def _enclosing(data: bytes) -> tuple[tuple[Array, Array], float]:
    """Return the ends of a capsule and its radius [m]; of points (k, 3), row by row."""
    from scipy.optimize import minimize  # here: importing SciPy is slow

    points = np.frombuffer(data).reshape(-1, 3)
    center = points.mean(axis=0)
    spread = points - center
    axes = np.linalg.svd(spread.T @ spread)[
        2
    ]  # always three, also for one or two points
    candidates = []
    for k in range(len(axes)):
        frame = np.roll(axes, -k, axis=0)  # the first row is the initial axis
        scale = float(np.ptp(points, axis=0).max()) or 1.0
        axis = partial(_axis, center, frame, scale)
        found = minimize(
            partial(_volume, points, axis),
            np.zeros(4),
            method="Nelder-Mead",
            options={"xatol": 1e-5, "fatol": 1e-12, "maxiter": 600},
        )
        candidates.append((float(found.fun), k, axis(found.x)))
    _, _, (anchor, direction) = min(candidates, key=lambda candidate: candidate[:2])
    low, high, radius = _segment(points, anchor, direction)
    return (anchor + low * direction, anchor + high * direction), radius


def _axis(center: Array, frame: Array, scale: float, x: Array) -> tuple[Array, Array]:
    """Return a point and the direction of the axis with parameters x, shape (4,)."""
    direction = frame[0] + x[0] * frame[1] + x[1] * frame[2]
    anchor = center + scale * (x[2] * frame[1] + x[3] * frame[2])
    return anchor, direction / np.linalg.norm(direction)


def _volume(
    points: Array, axis: Callable[[Array], tuple[Array, Array]], x: Array
) -> float:
    low, high, radius = _segment(points, *axis(x))
    return float(np.pi * radius**2 * (high - low + 4.0 / 3.0 * radius))


def _segment(
    points: Array, anchor: Array, direction: Array
) -> tuple[float, float, float]:
    """Return (low, high, radius) of the shortest capsule that contains the points."""
    away = points - anchor
    along = away @ direction
    away -= along[:, None] * direction
    across = np.sqrt(np.add.reduce(away * away, axis=1))
    radius = float(across.max())
    cap = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    low, high = float((along + cap).min()), float((along - cap).max())
    if low > high:
        low = high = 0.5 * (low + high)
        radius = float(np.hypot(across, along - low).max())
    return low, high, radius


def enclosing_ellipsoid_capsule(ellipsoid: Any) -> tuple[pin.SE3, float, float]:
    """Return pose (axis along z), radius and length of an ellipsoid's least capsule.

    With semi-axes a ≥ b ≥ c, it lies along the first, with the radius b and the length
    2 (a - b): at its ends the ellipsoid is more curved than a sphere of radius b.
    """
    radii = np.asarray(ellipsoid.radii, dtype=float)
    shortest, middle, longest = np.argsort(radii, kind="stable")
    axes = np.eye(3)[:, [shortest, middle, longest]]
    axes[:, 0] *= np.linalg.det(axes)  # a rotation
    radius = float(radii[middle])
    return pin.SE3(axes, np.zeros(3)), radius, 2.0 * (float(radii[longest]) - radius)
