"""Efforts that are delayed by whole periods."""

from collections import deque
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Periods
from hsp_control.robot import Robot
from hsp_control.simulation.plants.drives.drive import Drive, Driving


class EffortDelay(Drive, type="delay"):
    """The effort commanded some periods ago; the first effort until there is one."""

    stage: ClassVar[float] = 20.0

    periods: Periods
    """Delay of the efforts [control periods]."""

    @property
    def active(self) -> bool:
        """Whether there is a delay."""
        return self.periods > 0

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return a queue of efforts, empty at first; see `Drive.begin`."""
        queue: deque[Array] = deque()

        def drive(tau: Array) -> tuple[Array, float]:
            while len(queue) <= self.periods:
                queue.append(tau.copy())
            return queue.popleft(), 0.0

        return drive
