"""The plant of rigid bodies, as a value."""

from hsp_control.robot import Robot
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants.frictional import FrictionalPart
from hsp_control.simulation.plants.plant import Plant
from hsp_control.simulation.plants.rigid_body_plant import RigidBodyPlant
from hsp_control.simulation.plants.sticking_plant import StickingPlant

_STEP = 1e-3
"""Largest step of a plant with stiction, if the integrator has no step [s]."""


class RigidBody(FrictionalPart, type="rigid_body"):
    """Pinocchio's rigid-body dynamics; with friction, joints stick and slip."""

    def engine(self, robot: Robot, integrator: Integrator) -> Plant:
        """Return a `RigidBodyPlant`, or with friction a `StickingPlant`.

        Raises:
            FrameNotFoundError: If the frame of a push does not exist.
            SimulationError: If the friction does not fit the robot.
        """
        friction = self.joint_friction(robot)
        if friction is None:
            return RigidBodyPlant(robot, self.pushes)
        step = integrator.longest_step
        return StickingPlant(
            robot, friction, _STEP if step is None else step, self.pushes
        )
