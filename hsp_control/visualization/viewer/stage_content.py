"""The interface of what the viewer shows: a scene, a run, or several runs."""

from collections.abc import Iterator
from typing import Protocol

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.commands import Command
from hsp_control.visualization.viewer.legend import LegendEntry


class StageContent(Protocol):
    """Draws itself once, and returns the points that it will occupy."""

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""

    def points(self) -> Array:
        """Return where robots and targets will be [m], shape (K, 3); K may be 0."""

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles [m], shape (L, 3); L may be 0."""

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
