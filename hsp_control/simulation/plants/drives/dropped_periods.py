"""Efforts that are lost."""

from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Share
from hsp_control.robot import Robot
from hsp_control.simulation.plants.drives.drive import Drive, Driving


class DroppedPeriods(Drive, type="dropped"):
    """Efforts are lost at random, and the drive keeps the last one that arrived."""

    stage: ClassVar[float] = 10.0

    probability: Share
    """Probability that an effort is lost, independent of the others [-]; the first is
    never lost."""

    @property
    def active(self) -> bool:
        """Whether efforts are lost."""
        return self.probability > 0.0

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return what keeps the last effort that arrived; see `Drive.begin`."""
        last: Array | None = None

        def drive(tau: Array) -> tuple[Array, float]:
            nonlocal last
            lost = random.random() < self.probability
            if last is None or not lost:
                last = tau.copy()
            return last, 0.0

        return drive
