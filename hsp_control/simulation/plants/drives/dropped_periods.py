"""Efforts that never arrive."""

from dataclasses import dataclass

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.simulation.plants.chance import generator
from hsp_control.simulation.plants.drives.drive import Drive


@dataclass
class DroppedPeriods(Drive):
    """Now and then an effort is lost, and the drive goes on with the last one.

    Attributes:
        probability: That an effort is lost, each by itself; the first never is.
        seed: Of the random numbers.
    """

    probability: float
    seed: int = 0

    def __post_init__(self) -> None:
        """Refuse what is no probability."""
        if not 0.0 <= self.probability < 1.0:
            raise SimulationError(
                f"dropped periods: probability is {self.probability}; must be in 0..1"
            )

    def reset(self, robot: Robot) -> None:
        """Begin the random numbers anew; see `Drive.reset`."""
        self._rng = generator(self)
        self._last: Array | None = None

    def apply(self, tau: Array) -> Array:
        """Return the effort, or the last one that got through."""
        lost = self._rng.random() < self.probability
        if self._last is None or not lost:
            self._last = tau.copy()
        return self._last
