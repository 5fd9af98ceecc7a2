"""Efforts that are lost."""

from dataclasses import dataclass

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.simulation.plants.drives.drive import Drive
from hsp_control.simulation.plants.random_numbers import seeded_generator


@dataclass
class DroppedPeriods(Drive):
    """Efforts are lost at random, and the drive keeps the last one that arrived.

    Attributes:
        probability: Probability that an effort is lost, independent of the others; the
            first is never lost.
        seed: Seed of the random numbers.
    """

    probability: float
    seed: int = 0

    def __post_init__(self) -> None:
        """Check the probability."""
        if not 0.0 <= self.probability < 1.0:
            raise SimulationError(
                f"dropped periods: probability is {self.probability}; must be in 0..1"
            )

    def reset(self, robot: Robot) -> None:
        """Restart the random numbers; see `Drive.reset`."""
        self._rng = seeded_generator(self)
        self._last: Array | None = None

    def apply(self, tau: Array) -> Array:
        """Return the effort, or the last one that arrived; see `Drive.apply`."""
        lost = self._rng.random() < self.probability
        if self._last is None or not lost:
            self._last = tau.copy()
        return self._last
