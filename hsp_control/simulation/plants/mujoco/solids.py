"""Solid things in MuJoCo's world, which the robot's contact shapes can touch."""

from collections.abc import Sequence
from dataclasses import KW_ONLY
from typing import Annotated, ClassVar

import numpy as np
import pinocchio as pin
from pydantic import AfterValidator, Field

from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import Part
from hsp_control.declaration.named import BY_NAME, stored
from hsp_control.declaration.quantities import (
    ArrayField,
    Name,
    NonNegative,
    Positive,
    PositiveCount,
    ProperFraction,
    Vector3,
)
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.geometry.shapes import Shape
from hsp_control.simulation.plants.mujoco.contact_shapes import (
    Geom,
    geom_of,
    supported_shape,
)


class Solid(Part, error=SimulationError):
    """A fixed body: a wall, a table, a slope; with copies, stairs; a loose one: a box.

    The robot touches it with the shapes that the plant's ``contacts`` declare. What is
    loose also touches the ground and the other solids.

    MuJoCo's friction is soft: it damps the slip u as if the surfaces were to stop at
    the rate b, until the friction cone limits the force. A shape that goes on sliding
    is pushed off by the acceleration μ b ‖u‖, since the cone's dual couples the two.
    The surface supplies (1 - d)/d of the acceleration with which the shape is pressed;
    if that is less, the contact opens and closes for ever. With ``slip_damping`` b and
    ``impedance`` d things slide as Coulomb says, see ``docs/forces.md``.
    """

    yaml_key: ClassVar[str | None] = "name"

    name: Name
    """Its name in the log [-]; in YAML, its key."""
    shape: Annotated[Shape, AfterValidator(supported_shape)]
    """Its shape: a box, sphere, cylinder or capsule [-]."""
    position: Vector3 = (0.0, 0.0, 0.0)
    """Position of its middle in the world, at the start if it is loose [m]."""
    rotation: Rotation = (0.0, 0.0, 0.0)
    """Its rotation, likewise: roll, pitch and yaw [rad], a quaternion (x, y, z, w)
    [-], or a matrix [-]."""
    _: KW_ONLY
    mass: Positive | None = None
    """Mass of a loose body, evenly distributed [kg]; it is fixed by default."""
    friction: NonNegative = 0.8
    """Coulomb friction coefficient of its surface [-]; the ground's does not count."""
    slip_damping: Positive | None = None
    """Rate b at which MuJoCo's friction stops a slip [1/s]; MuJoCo's own by default,
    about 100. The smaller, the faster shapes creep where they stick."""
    impedance: ProperFraction | None = None
    """MuJoCo's impedance d of the surface [-]; its own by default, 0.9 to 0.95. The
    smaller, the deeper things press into it."""
    copies: PositiveCount = 1
    """How many there are, one beside the other [-]: the steps of stairs."""
    spacing: Vector3 = (0.0, 0.0, 0.0)
    """From each copy to the next, in the world [m]."""

    def __post_init__(self) -> None:
        """Check that copies do not lie inside one another."""
        if self.copies > 1 and not np.any(np.asarray(self.spacing)):
            raise SimulationError(
                f"{self.copies} copies have the spacing [0, 0, 0]; give another one"
            )

    def geoms(self) -> list[tuple[str, Geom]]:
        """Return the geoms with their names, placed in the world."""
        rotation = matrix_of(self.rotation)
        first, spacing = np.asarray(self.position), np.asarray(self.spacing)
        return [
            (
                f"solid/{self.name}/{k}",
                geom_of(self.shape.geometry(), pin.SE3(rotation, first + k * spacing)),
            )
            for k in range(self.copies)
        ]


Solids = Annotated[
    Sequence[Solid],
    ArrayField(Annotated[dict[Name, Solid], Field(max_length=100)], stored),
    BY_NAME,
]
"""Solids: a sequence in Python, a mapping by name in YAML."""
