"""A capsule."""

from typing import Any

import coal

from hsp_control.declaration.quantities import NonNegative, Positive
from hsp_control.geometry.shapes.shape import Shape


class Capsule(Shape, type="capsule"):
    """A cylinder with round ends, along its z axis."""

    radius: Positive
    """Radius [m]."""
    length: NonNegative
    """Distance between the centres of its round ends [m]."""

    def geometry(self) -> Any:
        """Return Coal's capsule."""
        return coal.Capsule(self.radius, self.length)

    @property
    def bounding_radius(self) -> float:
        """Half the overall length."""
        return self.radius + 0.5 * self.length
