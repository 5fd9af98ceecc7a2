"""Inertia of the motors' rotors, reflected through their gears."""

from dataclasses import dataclass
from typing import Any

import pinocchio as pin

from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.model_changes.model_change import ModelChange


@dataclass(frozen=True)
class MotorInertia(ModelChange):
    """Inertia that is added to the diagonal of the mass matrix.

    Attributes:
        inertia: Rotor inertia times the gear ratio squared [kg·m² or kg]: one number
            for all joints, or shape (nv,).
    """

    inertia: Any

    def apply(self, model: pin.Model, robot: Robot) -> None:
        """Add the inertia.

        Raises:
            SimulationError: If it is negative or does not fit the robot.
        """
        model.armature += per_dof(robot, self.inertia, "motor inertia")
