"""Inertia of the motors' rotors, reflected through their gears."""

import pinocchio as pin

from hsp_control.declaration.quantities import Weights
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.model_changes.model_change import ModelChange


class MotorInertia(ModelChange):
    """Inertia that is added to the diagonal of the mass matrix."""

    inertia: Weights
    """Rotor inertia times gear ratio squared [kg·m² or kg], one number or nv."""

    def apply(self, model: pin.Model, robot: Robot, seed: int) -> None:
        """Add the inertia."""
        model.armature += per_dof(robot, self.inertia)
