"""What a drive is: a link in the chain from the commanded effort to the joints."""

from abc import ABC, abstractmethod

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot


class Drive(ABC):
    """One imperfection on the way of an effort; several make a chain, in order."""

    @abstractmethod
    def reset(self, robot: Robot) -> None:
        """Begin a run, and forget the last one.

        Raises:
            SimulationError: If its settings do not fit the robot.
        """

    @abstractmethod
    def apply(self, tau: Array) -> Array:
        """Return what it makes of an effort, shape (nv,); called once a period."""

    def lateness(self) -> float:
        """Return by how much this period's effort comes late [s]."""
        return 0.0
