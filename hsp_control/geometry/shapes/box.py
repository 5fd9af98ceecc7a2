"""A box."""

from typing import Any

import coal
import numpy as np

from hsp_control.declaration.quantities import PositiveVector3
from hsp_control.geometry.shapes.shape import Shape


class Box(Shape, type="box"):
    """A box."""

    size: PositiveVector3
    """Lengths of its edges along x, y and z, shape (3,) [m]."""

    def geometry(self) -> Any:
        """Return Coal's box."""
        return coal.Box(*np.asarray(self.size))

    @property
    def bounding_radius(self) -> float:
        """Half the diagonal."""
        return 0.5 * float(np.linalg.norm(self.size))
