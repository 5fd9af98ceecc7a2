"""Convex hulls of meshes (by Coal) and of points; flat ones have no hull."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array


def convex_hull(mesh: Any) -> Any:
    """Return the hull of one of Coal's meshes; None if it is flat: Coal would abort."""
    from scipy.spatial import ConvexHull, QhullError  # here: SciPy takes long to import

    try:
        ConvexHull(np.array(mesh.vertices()), qhull_options="Qt")
    except QhullError:
        return None
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


def hull_corners(points: Array) -> Array:
    """Return those of the points (k, 3) that are their hull's vertices; all without."""
    from scipy.spatial import ConvexHull, QhullError  # here: SciPy takes long to import

    try:
        return points[ConvexHull(points, qhull_options="QJ").vertices]
    except QhullError:
        return points
