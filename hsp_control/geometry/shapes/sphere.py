"""A sphere."""

from typing import Any, ClassVar

import coal

from hsp_control.declaration.quantities import NonNegative
from hsp_control.geometry.shapes.shape import Shape


class Sphere(Shape, type="sphere"):
    """A ball; in the plane, a disk."""

    rounded: ClassVar[bool] = True

    radius: NonNegative
    """Radius [m]; 0 is a point."""

    def geometry(self) -> Any:
        """Return Coal's sphere."""
        return coal.Sphere(self.radius)

    @property
    def bounding_radius(self) -> float:
        """The radius."""
        return self.radius
