"""Friction in the joints: what a plant has of it."""

from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.robot.per_joint import per_dof
from hsp_control.robot.robot import Robot


@dataclass(frozen=True)
class JointFriction:
    """Friction that opposes each joint's motion: dry, and growing with speed.

    Attributes:
        coulomb: The largest dry friction, shape (nv,) [N·m or N]: at rest a joint
            sticks until more than that pushes it.
        viscous: Friction for each unit of speed, shape (nv,) [N·m·s/rad or N·s/m].
    """

    coulomb: Array
    viscous: Array

    @classmethod
    def of(cls, robot: Robot, coulomb: Any = 0.0, viscous: Any = 0.0) -> Self:
        """Return friction from numbers for all joints or one for each freedom.

        Raises:
            SimulationError: If a number is negative or does not fit the robot.
        """
        return cls(
            per_dof(robot, coulomb, "coulomb"),
            per_dof(robot, viscous, "viscous"),
        )

    @classmethod
    def of_model(cls, robot: Robot) -> Self:
        """Return the ``<dynamics friction= damping=>`` of the robot's URDF."""
        model = robot.model
        return cls.of(robot, np.abs(model.upperDryFrictionLimit), np.abs(model.damping))
