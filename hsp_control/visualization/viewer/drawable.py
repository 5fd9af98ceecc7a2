"""What the stage can be set for: a scene, a run, or several runs."""

from collections.abc import Iterator
from typing import Protocol

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.commands import Command


class Drawable(Protocol):
    """Draws itself once, and tells where it will be."""

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts it into a scene of some size [m]."""

    def points(self) -> Array:
        """Return where robots and targets will be [m], shape (K, 3); may be none."""

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles [m], shape (L, 3); may be none."""

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
