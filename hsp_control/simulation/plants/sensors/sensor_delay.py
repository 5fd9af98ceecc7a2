"""Measurements that arrive late."""

from collections import deque
from dataclasses import dataclass

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.simulation.plants.periods import check_periods
from hsp_control.simulation.plants.sensors.sensor import Sensor


@dataclass
class SensorDelay(Sensor):
    """The state of some periods ago; until there is one, that of the start.

    Attributes:
        periods: How many control periods it is old.
    """

    periods: int

    def __post_init__(self) -> None:
        """Refuse what is no number of periods."""
        check_periods(self.periods, "sensor delay")

    def reset(self, robot: Robot, t: float, q: Array, v: Array) -> None:
        """Fill the line with the start; see `Sensor.reset`."""
        self._line = deque([(q.copy(), v.copy())] * self.periods)

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Put the state into the line, and return what comes out of it."""
        self._line.append((q.copy(), v.copy()))
        return self._line.popleft()
