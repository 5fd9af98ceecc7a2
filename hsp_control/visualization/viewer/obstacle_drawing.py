"""Draws the obstacles of a scene: translucent, at their poses at a time."""

from collections.abc import Iterable, Iterator

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.geometry.scene import Scene
from hsp_control.geometry.shapes import Shape
from hsp_control.visualization.viewer.appearance import OBSTACLE
from hsp_control.visualization.viewer.commands import Command, set_object, set_transform
from hsp_control.visualization.viewer.legend import LegendEntry
from hsp_control.visualization.viewer.obstacle_shapes import obstacle
from hsp_control.visualization.viewer.robot_drawing import robot_entry
from hsp_control.visualization.viewer.scene_path import path_element

ROOT = "/obstacles"
_TOLD = 3
"""Number of obstacles that the legend names."""


def draw_obstacle(name: str, shape: Shape, extent: float) -> Command:
    """Return the command that draws an obstacle; see `obstacle`."""
    return set_object(_path(name), obstacle(shape, extent))


def move_obstacle(name: str, placement: pin.SE3) -> Command:
    """Return the command that moves an obstacle to a placement in the world."""
    return set_transform(_path(name), placement.homogeneous)


def enclosing_corners(shape: Shape, center: Array) -> list[Array]:
    """Return the two corners of the box around a shape; none if it is unbounded.

    Shapes: center (..., 3) [m].
    """
    reach = shape.bounding_radius
    if not np.isfinite(reach):
        return []
    return [center - reach, center + reach]


def obstacle_legend(names: Iterable[str], root: str = ROOT) -> list[LegendEntry]:
    """Return the legend of the obstacles: one entry, as all have the same colour."""
    known = list(names)
    if not known:
        return []
    told, more = known[:_TOLD], len(known) - _TOLD
    word = "obstacle" if len(known) == 1 else "obstacles"
    rest = f" and {more} more" if more > 0 else ""
    return [LegendEntry(f"{word} {', '.join(told)}{rest}", OBSTACLE, (root,))]


class ObstacleDrawing:
    """The obstacles of a scene."""

    def __init__(self, scene: Scene) -> None:
        """Store the scene."""
        self._scene = scene

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for item in self._scene.values():
            yield draw_obstacle(item.name, item.shape, 4.0 * size)

    def move(self, time: float) -> Iterator[Command]:
        """Yield the commands that move the obstacles to a time [s]."""
        for item in self._scene.values():
            yield move_obstacle(item.name, item.placement(time))

    def points(self) -> Array:
        """Return no points, shape (0, 3): the viewer knows the robot's."""
        return np.zeros((0, 3))

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles at the start [m], shape (K, 3)."""
        corners = [
            corner
            for item in self._scene.values()
            for corner in enclosing_corners(item.shape, item.placement(0.0).translation)
        ]
        return np.reshape(corners, (-1, 3))

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        return [*obstacle_legend(self._scene), robot_entry()]


def _path(name: str) -> str:
    return f"{ROOT}/{path_element(name)}"
