"""The interface of drives."""

from abc import ABC, abstractmethod

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot


class Drive(ABC):
    """One imperfection of the actuation; several make a chain, in their order."""

    @abstractmethod
    def reset(self, robot: Robot) -> None:
        """Begin a run, and clear all memory of the last one.

        Raises:
            SimulationError: If the settings do not fit the robot.
        """

    @abstractmethod
    def apply(self, tau: Array) -> Array:
        """Return the output for an effort, both shape (nv,); called once per period."""

    def delay(self) -> float:
        """Return the delay of this period's effort [s]; called once per period."""
        return 0.0
