"""The layer of a run's obstacles."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, set_object
from hsp_control.visualization.viewer.legend import LegendEntry
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.obstacle_drawing import (
    enclosing_corners,
    obstacle_legend,
)
from hsp_control.visualization.viewer.obstacle_shapes import logged_shape, obstacle
from hsp_control.visualization.viewer.scene_path import path_element


class ObstacleLayer:
    """The obstacles of a log."""

    def __init__(self, motion: Motion, root: str) -> None:
        """Read the log's obstacles."""
        self._root = root
        self._rows = motion.rows
        self.shapes = {
            name: shape
            for name, about in motion.rows.meta.get("obstacles", {}).items()
            if (shape := logged_shape(about)) and f"obstacle.{name}" in motion.rows
        }

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for name, shape in self.shapes.items():
            yield set_object(self._path(name), obstacle(shape, 4.0 * size))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        for name in self.shapes:
            yield from obstacle_tracks(self._path(name), name, motion)

    def points(self) -> Array:
        """Return points that enclose the obstacles in the run [m], shape (K, 3)."""
        clouds = [
            corners
            for name, shape in self.shapes.items()
            for corners in enclosing_corners(shape, self._rows[f"obstacle.{name}"])
        ]
        return np.concatenate([np.zeros((0, 3)), *clouds])

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        return obstacle_legend(self.shapes, self._root)

    def _path(self, name: str) -> str:
        return f"{self._root}/{path_element(name)}"


def obstacle_tracks(path: str, name: str, motion: Motion) -> Iterator[Track]:
    """Yield the tracks of a node that follows a logged obstacle."""
    yield Track(path, "position", motion.times, motion.rows[f"obstacle.{name}"])
    turns = f"obstacle.{name}.quaternion"
    if turns in motion.rows:
        yield Track(path, "quaternion", motion.times, motion.rows[turns])
