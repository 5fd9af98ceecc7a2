"""Efforts that arrive late."""

from collections import deque
from dataclasses import dataclass

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.simulation.plants.drives.drive import Drive
from hsp_control.simulation.plants.periods import check_periods


@dataclass
class EffortDelay(Drive):
    """The effort commanded some periods ago; until there is one, the first.

    Attributes:
        periods: How many control periods it is late.
    """

    periods: int

    def __post_init__(self) -> None:
        """Refuse what is no number of periods."""
        check_periods(self.periods, "effort delay")

    def reset(self, robot: Robot) -> None:
        """Empty the line; see `Drive.reset`."""
        self._line: deque[Array] = deque()

    def apply(self, tau: Array) -> Array:
        """Put the effort into the line, and return what comes out of it."""
        while len(self._line) <= self.periods:
            self._line.append(tau.copy())
        return self._line.popleft()
