"""The interface of a layer: one kind of drawing that is switched on and off as one."""

from collections.abc import Iterator
from typing import Protocol

from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command
from hsp_control.visualization.viewer.legend import LegendEntry
from hsp_control.visualization.viewer.motion import Motion


class Layer(Protocol):
    """Draws itself once, and returns the tracks of its motion."""

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along a run, or along a part of one."""

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
