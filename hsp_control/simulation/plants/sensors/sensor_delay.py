"""Delayed measurements."""

from collections import deque
from dataclasses import dataclass

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.simulation.plants.periods import check_periods
from hsp_control.simulation.plants.sensors.sensor import Sensor


@dataclass
class SensorDelay(Sensor):
    """The state of some periods ago; the start state until there is one.

    Attributes:
        periods: Delay in control periods.
    """

    periods: int

    def __post_init__(self) -> None:
        """Check the number of periods."""
        check_periods(self.periods, "sensor delay")

    def reset(self, robot: Robot, t: float, q: Array, v: Array) -> None:
        """Fill the queue with the start state; see `Sensor.reset`."""
        self._queue = deque([(q.copy(), v.copy())] * self.periods)

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Append the state, and return the oldest one; see `Sensor.measure`."""
        self._queue.append((q.copy(), v.copy()))
        return self._queue.popleft()
