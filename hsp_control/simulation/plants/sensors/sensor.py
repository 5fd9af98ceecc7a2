"""What a sensor is: a link in the chain from the true state to the controller."""

from abc import ABC, abstractmethod

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot


class Sensor(ABC):
    """One imperfection of what is measured; several make a chain, in their order."""

    @abstractmethod
    def reset(self, robot: Robot, t: float, q: Array, v: Array) -> None:
        """Begin a run at time t [s] in the true state q, v, and forget the last one.

        Raises:
            SimulationError: If its settings do not fit the robot.
        """

    @abstractmethod
    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return (q, v) as this sensor passes them on; called once a control period."""
