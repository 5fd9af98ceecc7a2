"""A layer: one kind of thing that is drawn beside the robot, to be switched as one."""

from collections.abc import Iterator
from typing import Protocol

from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command
from hsp_control.visualization.viewer.motion import Motion


class Layer(Protocol):
    """Draws itself once, and tells how it moves."""

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts it into a scene of some size [m]."""

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield how it moves along a run, or along a part of one."""

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
