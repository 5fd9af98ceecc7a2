"""Fewer triangles, with a bound on how far any vertex lies from what is left."""

import numpy as np
import scipy.spatial

from hsp_control.arrays import Array, Indices
from hsp_control.exceptions import ExportError
from hsp_control.viewer.export.meshes import INSTALL

_ERRORS = (0.3, 0.15, 0.07)
"""What to allow the quadric error, over the bound; the most that keeps the bound."""
_NEAR, _MORE = 4, 64
"""Nearest points that are looked at, and where those do not settle it."""
_SAMPLES = 4
"""Points on a triangle, on average."""


def simplify(vertices: Array, triangles: Indices, bound: float) -> Indices:
    """Return fewer triangles of the same vertices, as few as the bound allows.

    By the quadric error of Garland and Heckbert (1997), which tells what to collapse
    but not how far the surface moves: that is measured, see `deviation`.

    Args:
        vertices: Welded, shape (n, 3).
        triangles: Shape (k, 3).
        bound: How far any vertex may be from the surface that is left.

    Raises:
        ExportError: If meshoptimizer is not installed.
    """
    try:
        import meshoptimizer
    except ImportError as error:
        raise ExportError(f"lighter meshes need {error.name}: {INSTALL}") from None
    places = np.ascontiguousarray(vertices, np.float32)
    corners = np.ascontiguousarray(triangles.ravel(), np.uint32)
    for share in _ERRORS:
        fewer = np.zeros(corners.size, np.uint32)
        count = meshoptimizer.simplify(
            fewer,
            corners,
            places,
            target_index_count=0,
            target_error=share * bound,
            # Where another piece begins, both must go on meeting.
            options=meshoptimizer.SIMPLIFY_ERROR_ABSOLUTE
            | meshoptimizer.SIMPLIFY_LOCK_BORDER,
        )
        faces = fewer[:count].astype(np.int64).reshape(-1, 3)
        if count and deviation(vertices, triangles, faces, bound) <= bound:
            return faces
    return triangles


def deviation(
    vertices: Array, triangles: Indices, faces: Indices, bound: float
) -> float:
    """Return how far a vertex of a surface is from some of its triangles, at most.

    Args:
        vertices: Shape (n, 3).
        triangles: All of them, shape (k, 3).
        faces: What is left, shape (l, 3), of the same vertices.
        bound: Distances over it are worth a closer look.
    """
    probes = vertices[np.setdiff1d(triangles, faces)]
    if not len(probes):
        return 0.0
    corners = vertices[faces]
    distances = _distances(probes, corners, _NEAR)
    far = distances > bound
    distances[far] = _distances(probes[far], corners, _MORE)
    return float(distances.max())


def _distances(probes: Array, triangles: Array, candidates: int) -> Array:
    """Return upper bounds of the distances of points (n, 3) from triangles (k, 3, 3).

    From those on which the nearest of many points lie: no other need be nearer.
    """
    points, face_of = _sampled(triangles)
    count = min(candidates, len(points))
    _, nearest = scipy.spatial.cKDTree(points).query(probes, k=count)
    least = np.full(len(probes), np.inf)
    for face in face_of[nearest].reshape(-1, count).T:
        least = np.minimum(least, distance_to_triangles(probes, triangles[face]))
    return least


def _sampled(triangles: Array) -> tuple[Array, Indices]:
    """Return points of triangles (n, 3, 3) and whose they are: more on larger ones."""
    sides = triangles[:, 1:] - triangles[:, :1]
    area = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1)
    share = area / (float(area.sum()) or 1.0)
    count = 1 + np.floor(share * _SAMPLES * len(triangles)).astype(np.int64)
    face = np.repeat(np.arange(len(triangles)), count)
    number = np.arange(len(face)) - np.repeat(np.cumsum(count) - count, count)
    # Roberts's (2018) sequence covers the unit square evenly; folded, the triangle.
    u = (0.5 + number * 0.7548776662466927) % 1.0
    v = (0.5 + number * 0.5698402909980532) % 1.0
    fold = u + v > 1.0
    u, v = np.where(fold, 1.0 - u, u), np.where(fold, 1.0 - v, v)
    a, b, c = triangles[face].transpose(1, 0, 2)
    return a + u[:, None] * (b - a) + v[:, None] * (c - a), face


def distance_to_triangles(points: Array, triangles: Array) -> Array:
    """Return the distance of each point (n, 3) from its triangle (n, 3, 3)."""
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    flat = area <= 1e-14 * np.maximum(1e-300, np.abs(triangles).max(axis=(1, 2)) ** 2)
    unit = normal / np.where(flat, 1.0, area)[:, None]
    inside = ~flat
    least = np.full(len(points), np.inf)
    for start, end in ((a, b), (b, c), (c, a)):
        edge = end - start
        inside &= np.sum(np.cross(edge, points - start) * unit, axis=1) >= 0.0
        length = np.sum(edge * edge, axis=1)
        along = np.sum((points - start) * edge, axis=1) / np.where(length, length, 1.0)
        nearest = start + np.clip(along, 0.0, 1.0)[:, None] * edge
        least = np.minimum(least, np.linalg.norm(points - nearest, axis=1))
    plane = np.abs(np.sum((points - a) * unit, axis=1))
    return np.where(inside, plane, least)
