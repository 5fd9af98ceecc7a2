"""A half-space."""

from typing import Any

import coal
import numpy as np

from hsp_control.geometry.shapes.shape import Shape


class HalfSpace(Shape, type="plane"):
    """All points below its own x-y plane: a floor, or a wall if it is turned."""

    def geometry(self) -> Any:
        """Return Coal's half-space."""
        return coal.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)

    @property
    def bounding_radius(self) -> float:
        """Infinity."""
        return float("inf")
