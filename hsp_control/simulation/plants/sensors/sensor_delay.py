"""Delayed measurements."""

from collections import deque
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Periods
from hsp_control.robot import Robot
from hsp_control.simulation.plants.sensors.sensor import Sensing, Sensor


class SensorDelay(Sensor, type="delay"):
    """The state of some periods ago; the start state until there is one."""

    stage: ClassVar[float] = 10.0

    periods: Periods
    """Delay of the measurements [control periods]."""

    @property
    def active(self) -> bool:
        """Whether there is a delay."""
        return self.periods > 0

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return a queue that is full of the start state; see `Sensor.begin`."""
        queue = deque([(q.copy(), v.copy())] * self.periods)

        def sense(t: float, q: Array, v: Array) -> tuple[Array, Array]:
            queue.append((q.copy(), v.copy()))
            return queue.popleft()

        return sense
