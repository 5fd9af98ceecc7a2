"""The smallest capsule that holds a set of points."""

from collections.abc import Callable
from functools import partial

import numpy as np
from scipy.optimize import minimize

from hsp_control.common.arrays import Array


def enclosing_capsule(points: Array) -> tuple[Array, Array, float]:
    """Return the ends and the radius of a small capsule that holds the points.

    Its axis is found by a local search over direction and offset from each of the
    three principal axes; for a given axis the shortest segment is exact.

    Args:
        points: Shape (k, 3) [m].

    Returns:
        (first end, second end, radius); the ends are equal for a ball.
    """
    center = points.mean(axis=0)
    spread = points - center
    axes = np.linalg.svd(spread.T @ spread)[2]  # three, however few the points
    candidates = []
    for k in range(len(axes)):
        frame = np.roll(axes, -k, axis=0)  # its first row is the axis tried
        scale = float(np.ptp(points, axis=0).max()) or 1.0
        search = partial(_axis, center, frame, scale)
        found = minimize(
            partial(_volume_along, points, search),
            np.zeros(4),
            method="Nelder-Mead",
            options={"xatol": 1e-5, "fatol": 1e-12, "maxiter": 600},
        )
        candidates.append((float(found.fun), k, search(found.x)))
    _, _, (anchor, direction) = min(candidates, key=lambda candidate: candidate[:2])
    low, high, radius = _segment(points, anchor, direction)
    return anchor + low * direction, anchor + high * direction, radius


def _axis(center: Array, frame: Array, scale: float, x: Array) -> tuple[Array, Array]:
    direction = frame[0] + x[0] * frame[1] + x[1] * frame[2]
    anchor = center + scale * (x[2] * frame[1] + x[3] * frame[2])
    return anchor, direction / np.linalg.norm(direction)


def _volume_along(
    points: Array, search: Callable[[Array], tuple[Array, Array]], x: Array
) -> float:
    low, high, radius = _segment(points, *search(x))
    return float(np.pi * radius**2 * (high - low + 4.0 / 3.0 * radius))


def _segment(
    points: Array, anchor: Array, direction: Array
) -> tuple[float, float, float]:
    """Return the shortest segment on an axis whose capsule holds the points."""
    along = (points - anchor) @ direction
    across = np.linalg.norm(points - anchor - np.outer(along, direction), axis=1)
    radius = float(across.max())
    cap = np.sqrt(np.maximum(radius**2 - across**2, 0.0))
    low, high = float((along + cap).min()), float((along - cap).max())
    if low > high:
        low = high = 0.5 * (low + high)
        radius = float(np.hypot(across, along - low).max())
    return low, high, radius
