"""A terrain on a regular grid."""

from typing import Any

import coal
import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Grid, PositiveVector2
from hsp_control.geometry.shapes.shape import Shape


class HeightField(Shape, type="height_field"):
    """A terrain: heights on a regular grid about the origin, as a triangle mesh.

    Coal has height fields, but computes no distances to them.
    """

    size: PositiveVector2
    """Extent along x and y, shape (2,) [m]."""
    heights: Grid
    """Heights, one row for each y, shape (≥ 2, ≥ 2) [m]."""

    def geometry(self) -> Any:
        """Return Coal's mesh with two triangles per cell."""
        rows, columns = np.shape(self.heights)
        vertices = self._vertices()
        mesh = coal.BVHModelOBBRSS()
        mesh.beginModel(2 * (rows - 1) * (columns - 1), len(vertices))
        for i in range(rows - 1):
            for j in range(columns - 1):
                a = i * columns + j
                b, c, d = a + 1, a + columns, a + columns + 1
                mesh.addTriangle(vertices[a], vertices[b], vertices[d])
                mesh.addTriangle(vertices[a], vertices[d], vertices[c])
        mesh.endModel()
        return mesh

    @property
    def bounding_radius(self) -> float:
        """Distance of the farthest vertex from the origin."""
        return float(np.linalg.norm(self._vertices(), axis=1).max())

    def _vertices(self) -> Array:
        width, depth = np.asarray(self.size)
        grid = np.asarray(self.heights)
        x = np.linspace(-0.5, 0.5, grid.shape[1]) * width
        y = np.linspace(-0.5, 0.5, grid.shape[0]) * depth
        X, Y = np.meshgrid(x, y)
        return np.column_stack([X.ravel(), Y.ravel(), grid.ravel()])
