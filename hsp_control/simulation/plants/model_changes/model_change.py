"""The interface of changes of a robot's model that the controller does not know."""

from abc import ABC, abstractmethod
from collections.abc import Iterable

import pinocchio as pin

from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import Part
from hsp_control.robot import Robot


class ModelChange(Part, ABC, error=SimulationError):
    """A change of masses, centres of mass or inertias; joints and frames are kept."""

    @abstractmethod
    def apply(self, model: pin.Model, robot: Robot, seed: int) -> None:
        """Change a model in place.

        Args:
            model: A copy of the robot's model.
            robot: The robot.
            seed: Seed of random numbers.

        Raises:
            HspControlError: If the change does not fit the robot.
        """


def changed(robot: Robot, changes: Iterable[ModelChange], seed: int = 0) -> Robot:
    """Return a new robot with all changes applied in order.

    It has no description: loading that again would give the robot without changes.
    """
    model = robot.model.copy()
    for change in changes:
        change.apply(model, robot, seed)
    return Robot(model, robot.source, robot.parts)
