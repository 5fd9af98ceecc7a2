"""Joint friction of a plant."""

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import Weights
from hsp_control.robot.robot import Robot


@dataclass(frozen=True)
class JointFriction:
    """Coulomb and viscous friction in every joint of one robot.

    Attributes:
        coulomb: Dry friction, shape (nv,) [N·m or N]; a joint at rest sticks until the
            effort on it exceeds this value.
        viscous: Friction per velocity, shape (nv,) [N·m·s/rad or N·s/m].
    """

    coulomb: Array
    viscous: Array

    @classmethod
    def of(
        cls, robot: Robot, coulomb: ArrayLike = 0.0, viscous: ArrayLike = 0.0
    ) -> Self:
        """Return friction from one number for all joints, or nv numbers."""
        given = Friction(coulomb, viscous)
        with within("coulomb"):
            dry = robot.per_dof(given.coulomb)
        with within("viscous"):
            return cls(dry, robot.per_dof(given.viscous))

    @classmethod
    def of_model(cls, robot: Robot) -> Self:
        """Return the friction in the URDF: ``<dynamics friction= damping=>``."""
        model = robot.model
        return cls.of(robot, np.abs(model.upperDryFrictionLimit), np.abs(model.damping))


class Friction(Part, error=SimulationError):
    """Friction of the joints."""

    coulomb: Weights = 0.0
    """Coulomb friction [N·m or N], one number or nv; a joint at rest sticks until the
    effort on it exceeds this value."""
    viscous: Weights = 0.0
    """Viscous friction [N·m·s/rad or N·s/m], one number or nv."""

    def of(self, robot: Robot) -> JointFriction:
        """Return the friction of a robot's joints."""
        return JointFriction.of(robot, self.coulomb, self.viscous)
