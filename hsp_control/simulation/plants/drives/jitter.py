"""Efforts that come at no certain moment."""

from dataclasses import dataclass

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.simulation.plants.chance import generator
from hsp_control.simulation.plants.drives.drive import Drive


@dataclass
class Jitter(Drive):
    """Every effort takes over late, by a uniformly random time.

    Attributes:
        longest: The longest lateness [s]; an effort never waits beyond its period.
        seed: Of the random numbers.
    """

    longest: float
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what is no time."""
        if not 0.0 <= self.longest < np.inf:
            raise SimulationError(
                f"jitter: the longest lateness is {self.longest} s; must be positive"
            )

    def reset(self, robot: Robot) -> None:
        """Begin the random numbers anew; see `Drive.reset`."""
        self._rng = generator(self)

    def apply(self, tau: Array) -> Array:
        """Leave the effort as it is."""
        return tau

    def lateness(self) -> float:
        """Draw this period's."""
        return float(self._rng.uniform(0.0, self.longest))
