"""The interface of sensors."""

from abc import ABC, abstractmethod

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot


class Sensor(ABC):
    """One imperfection of the measurement; several make a chain, in their order."""

    @abstractmethod
    def reset(self, robot: Robot, t: float, q: Array, v: Array) -> None:
        """Begin a run, and clear all memory of the last one.

        Args:
            robot: The robot.
            t: Start time [s].
            q: True configuration at the start, shape (nq,).
            v: True velocity at the start, shape (nv,).

        Raises:
            SimulationError: If the settings do not fit the robot.
        """

    @abstractmethod
    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return (q, v) as measured; it is called once per control period.

        Args:
            t: Time [s].
            q: Configuration from the sensor before, shape (nq,).
            v: Velocity from the sensor before, shape (nv,).
        """
