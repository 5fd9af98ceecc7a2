"""Convex hulls of meshes (by Coal) and of points; flat ones have no hull."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array


def convex_hull(mesh: Any) -> Any:
    """Return the convex hull of one of Coal's meshes, or None if the mesh is flat.

    For a flat mesh Coal would abort the process.
    """
    from scipy.spatial import ConvexHull, QhullError  # here: SciPy takes long to import

    try:
        ConvexHull(np.array(mesh.vertices()), qhull_options="Qt")
    except QhullError:
        return None
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


def hull_corners(points: Array) -> Array:
    """Return those of the points, shape (k, 3), that are vertices of their hull.

    All points are returned if they have no hull: too few points, or all at one place.
    """
    from scipy.spatial import ConvexHull, QhullError  # here: SciPy takes long to import

    try:
        return points[ConvexHull(points, qhull_options="QJ").vertices]
    except QhullError:
        return points
