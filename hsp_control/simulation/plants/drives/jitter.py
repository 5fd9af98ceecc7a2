"""Efforts that arrive with a random delay within their period."""

from typing import ClassVar

import numpy as np

from hsp_control.declaration.quantities import NonNegative
from hsp_control.robot import Robot
from hsp_control.simulation.plants.drives.drive import Drive, Driving


class Jitter(Drive, type="jitter"):
    """Every effort takes effect after a uniformly random delay."""

    stage: ClassVar[float] = 30.0

    longest: NonNegative
    """Maximum additional delay [s], drawn for each period; an effort takes effect at
    the end of its period at the latest."""

    @property
    def active(self) -> bool:
        """Whether there is a delay."""
        return self.longest > 0.0

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return what draws a delay for each effort; see `Drive.begin`."""
        return lambda tau: (tau, float(random.uniform(0.0, self.longest)))
