"""Efforts that arrive with a random delay within their period."""

from dataclasses import dataclass

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.simulation.plants.drives.drive import Drive
from hsp_control.simulation.plants.random_numbers import seeded_generator


@dataclass
class Jitter(Drive):
    """Every effort takes effect after a uniformly random delay.

    Attributes:
        longest: The longest delay [s]; an effort takes effect at the end of its period
            at the latest.
        seed: Seed of the random numbers.
    """

    longest: float
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the longest delay."""
        if not 0.0 <= self.longest < np.inf:
            raise SimulationError(
                f"jitter: the longest delay is {self.longest} s; must not be negative"
            )

    def reset(self, robot: Robot) -> None:
        """Restart the random numbers; see `Drive.reset`."""
        self._rng = seeded_generator(self)

    def apply(self, tau: Array) -> Array:
        """Return the effort unchanged; see `Drive.apply`."""
        return tau

    def delay(self) -> float:
        """Return a random delay [s]; see `Drive.delay`."""
        return float(self._rng.uniform(0.0, self.longest))
