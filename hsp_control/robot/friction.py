"""Joint friction of a plant."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.robot.per_joint import per_dof
from hsp_control.robot.robot import Robot


@dataclass(frozen=True)
class JointFriction:
    """Coulomb and viscous friction in each joint.

    Attributes:
        coulomb: Dry friction, shape (nv,) [N·m or N]; a joint at rest sticks until the
            effort on it exceeds this value.
        viscous: Friction per velocity, shape (nv,) [N·m·s/rad or N·s/m].
    """

    coulomb: Array
    viscous: Array

    @classmethod
    def of(cls, robot: Robot, coulomb: Any = 0.0, viscous: Any = 0.0) -> Self:
        """Return friction from one number for all joints, or nv numbers.

        Args:
            robot: The robot.
            coulomb: One number or shape (nv,) [N·m or N].
            viscous: One number or shape (nv,) [N·m·s/rad or N·s/m].

        Raises:
            SimulationError: If a number is negative or not finite, or the shape is
                wrong.
        """
        return cls(
            per_dof(robot, coulomb, "coulomb"),
            per_dof(robot, viscous, "viscous"),
        )

    @classmethod
    def of_model(cls, robot: Robot) -> Self:
        """Return the friction in the URDF: ``<dynamics friction= damping=>``."""
        model = robot.model
        return cls.of(robot, np.abs(model.upperDryFrictionLimit), np.abs(model.damping))
