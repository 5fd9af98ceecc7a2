"""What is shown besides the robot, whether it comes from a scene or from a log."""

from collections.abc import Iterator
from typing import Protocol

from hsp_control.arrays import Array
from hsp_control.viewer.commands import Command


class Surroundings(Protocol):
    """Draws itself once, then moves with time."""

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts it into a scene of some size [m]."""

    def move(self, time: float) -> Iterator[Command]:
        """Yield what moves it to where it is at a time [s]."""

    def points(self) -> Array:
        """Return where robot and targets will be [m], shape (K, 3); may be none."""

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles [m], shape (L, 3); may be none."""

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
