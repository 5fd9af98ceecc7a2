"""Efforts that are delayed by whole periods."""

from collections import deque
from dataclasses import dataclass

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.simulation.plants.drives.drive import Drive
from hsp_control.simulation.plants.periods import check_periods


@dataclass
class EffortDelay(Drive):
    """The effort commanded some periods ago; the first effort until there is one.

    Attributes:
        periods: Delay in control periods.
    """

    periods: int

    def __post_init__(self) -> None:
        """Check the number of periods."""
        check_periods(self.periods, "effort delay")

    def reset(self, robot: Robot) -> None:
        """Empty the queue; see `Drive.reset`."""
        self._queue: deque[Array] = deque()

    def apply(self, tau: Array) -> Array:
        """Append the effort, and return the oldest one; see `Drive.apply`."""
        while len(self._queue) <= self.periods:
            self._queue.append(tau.copy())
        return self._queue.popleft()
