"""A cloud of points."""

from typing import Any, ClassVar

import coal
import numpy as np

from hsp_control.declaration.quantities import Points, Positive
from hsp_control.geometry.shapes.shape import Shape


class PointCloud(Shape, type="point_cloud"):
    """Measured points; each becomes a cube of the resolution (Coal's octree)."""

    witness_reversed: ClassVar[bool] = True

    points: Points
    """The points, shape (k, 3) [m]."""
    resolution: Positive = 0.02
    """Edge of the cube that represents each point [m]."""

    def geometry(self) -> Any:
        """Return Coal's octree."""
        return coal.makeOctree(np.asarray(self.points), self.resolution)

    @property
    def bounding_radius(self) -> float:
        """Distance of the farthest point from the origin, and its cube."""
        far = float(np.linalg.norm(self.points, axis=1).max())
        return far + 2.0 * self.resolution
