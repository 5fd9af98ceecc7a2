"""A cylinder."""

from typing import Any

import coal
import numpy as np

from hsp_control.declaration.quantities import Positive
from hsp_control.geometry.shapes.shape import Shape


class Cylinder(Shape, type="cylinder"):
    """A cylinder along its z axis."""

    radius: Positive
    """Radius [m]."""
    length: Positive
    """Height [m]."""

    def geometry(self) -> Any:
        """Return Coal's cylinder."""
        return coal.Cylinder(self.radius, self.length)

    @property
    def bounding_radius(self) -> float:
        """Half the diagonal."""
        return float(np.hypot(self.radius, 0.5 * self.length))
