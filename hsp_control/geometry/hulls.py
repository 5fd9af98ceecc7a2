"""Convex hulls: of meshes, by Coal, and the corners of points; some have none."""

from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from hsp_control.common.arrays import Array


def convex_hull(mesh: Any) -> Any:
    """Return the convex hull of Coal's mesh; None of one that is flat.

    At those Coal ends the process.
    """
    try:
        ConvexHull(np.array(mesh.vertices()), qhull_options="Qt")
    except QhullError:
        return None
    mesh.buildConvexHull(True, "Qt")
    return mesh.convex


def hull_corners(points: Array) -> Array:
    """Return the points, shape (k, 3), that are corners of their hull.

    All of them if they are too few to have one, or in one place.
    """
    try:
        return points[ConvexHull(points, qhull_options="QJ").vertices]
    except QhullError:
        return points
