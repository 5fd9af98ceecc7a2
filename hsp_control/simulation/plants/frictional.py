"""Plants whose joints may have friction."""

from abc import ABC
from dataclasses import KW_ONLY
from typing import Literal

from hsp_control.declaration import within
from hsp_control.robot import Robot
from hsp_control.robot.friction import Friction, JointFriction
from hsp_control.simulation.plants.declared import PlantPart


class FrictionalPart(PlantPart, ABC):
    """A plant whose joints may have friction."""

    _: KW_ONLY
    friction: Literal["urdf"] | Friction | None = None
    """Friction of the joints [-]; ``urdf`` takes it from the robot's file. None by
    default."""

    def joint_friction(self, robot: Robot) -> JointFriction | None:
        """Return the friction of a robot's joints, None if there is none.

        Raises:
            SimulationError: If it does not fit the robot.
        """
        if self.friction is None:
            return None
        if self.friction == "urdf":
            return JointFriction.of_model(robot)
        with within("friction"):
            return self.friction.of(robot)
