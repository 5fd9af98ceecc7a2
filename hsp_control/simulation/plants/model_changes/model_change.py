"""What changes a robot's model behind the controller's back."""

from abc import ABC, abstractmethod
from collections.abc import Iterable

import pinocchio as pin

from hsp_control.robot import Robot


class ModelChange(ABC):
    """A change of masses, centres of mass or inertias; joints and frames stay."""

    @abstractmethod
    def apply(self, model: pin.Model, robot: Robot) -> None:
        """Change a model, which is a copy of the robot's.

        Raises:
            HspControlError: If the robot lacks what is to be changed.
        """


def changed(robot: Robot, changes: Iterable[ModelChange]) -> Robot:
    """Return another robot, with all changes made in their order."""
    model = robot.model.copy()
    for change in changes:
        change.apply(model, robot)
    return Robot(model, robot.source, robot.parts)
