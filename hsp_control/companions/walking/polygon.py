"""The convex hull of points of the ground: its nearest point, and paths out of it."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array


def convex_hull(points: Array) -> Array:
    """Return the corners of the convex hull, anticlockwise, shape (m, 2).

    Andrew's monotone chain (1979).
    """
    ordered = sorted(map(tuple, points.tolist()))
    lower, upper = _chain(ordered), _chain(ordered[::-1])
    return np.array([*lower[:-1], *upper[:-1]])


def nearest_inside(corners: Array, point: Array) -> Array:
    """Return the point of a convex polygon that is nearest to a point, shape (2,)."""
    edges = np.roll(corners, -1, axis=0) - corners
    to_point = point - corners
    if (edges[:, 0] * to_point[:, 1] - edges[:, 1] * to_point[:, 0] >= 0.0).all():
        return point
    lengths = np.maximum((edges * edges).sum(axis=1), 1e-18)
    shares = np.clip((edges * to_point).sum(axis=1) / lengths, 0.0, 1.0)
    nearest = corners + shares[:, None] * edges
    distances = ((nearest - point) ** 2).sum(axis=1)
    return np.asarray(nearest[int(distances.argmin())])


def last_inside(corners: Array, start: Array, end: Array) -> Array:
    """Return the last point of a segment that is in a convex polygon, shape (2,)."""
    edges = np.roll(corners, -1, axis=0) - corners
    way, away = end - start, start - corners
    # Distance of each edge to the right of the start, and rate of approach to it.
    room = np.maximum(edges[:, 0] * away[:, 1] - edges[:, 1] * away[:, 0], 0.0)
    rate = edges[:, 1] * way[0] - edges[:, 0] * way[1]
    leaves = rate > room
    if not leaves.any():
        return end
    return np.asarray(start + (room[leaves] / rate[leaves]).min() * way)


def _chain(points: Sequence[tuple[float, ...]]) -> list[tuple[float, ...]]:
    chain: list[tuple[float, ...]] = []
    for c in points:
        while len(chain) > 1:
            a, b = chain[-2:]
            if (b[0] - a[0]) * (c[1] - a[1]) > (b[1] - a[1]) * (c[0] - a[0]):
                break  # the path a, b, c turns left
            chain.pop()
        chain.append(c)
    return chain
