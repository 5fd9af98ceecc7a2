"""The interface of changes of a robot's model that the controller does not know."""

from abc import ABC, abstractmethod
from collections.abc import Iterable

import pinocchio as pin

from hsp_control.robot import Robot


class ModelChange(ABC):
    """A change of masses, centres of mass or inertias; joints and frames are kept."""

    @abstractmethod
    def apply(self, model: pin.Model, robot: Robot) -> None:
        """Change a model in place.

        Args:
            model: A copy of the robot's model.
            robot: The robot.

        Raises:
            HspControlError: If the change does not fit the robot.
        """


def changed(robot: Robot, changes: Iterable[ModelChange]) -> Robot:
    """Return a new robot with all changes applied in order."""
    model = robot.model.copy()
    for change in changes:
        change.apply(model, robot)
    return Robot(model, robot.source, robot.parts)
