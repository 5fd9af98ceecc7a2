"""Obstacles in the scene: translucent, each where its trajectory leads it."""

from collections.abc import Iterable, Iterator

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.geometry.scene import Scene
from hsp_control.geometry.shapes import Shape
from hsp_control.visualization.viewer.appearance import OBSTACLE
from hsp_control.visualization.viewer.commands import Command, set_object, set_transform
from hsp_control.visualization.viewer.element import element
from hsp_control.visualization.viewer.obstacle_shapes import obstacle

ROOT = "/obstacles"


def draw_obstacle(name: str, shape: Shape, extent: float) -> Command:
    """Return what puts an obstacle into the scene; see `obstacle`."""
    return set_object(_path(name), obstacle(shape, extent))


def move_obstacle(name: str, placement: pin.SE3) -> Command:
    """Return what moves an obstacle to its placement in the world."""
    return set_transform(_path(name), placement.homogeneous)


def enclosing(shape: Shape, center: Array) -> list[Array]:
    """Return corners of boxes about balls that hold a shape at its centres [m]."""
    reach = shape.reach
    if not np.isfinite(reach):
        return []
    return [center - reach, center + reach]


def obstacle_legend(names: Iterable[str]) -> list[tuple[str, str]]:
    """Return the obstacles' names and colour: one entry, for all look the same."""
    text = ", ".join(names)
    return [(text, OBSTACLE)] if text else []


class ObstacleDrawing:
    """The obstacles of a scene."""

    def __init__(self, scene: Scene) -> None:
        """Draw this scene."""
        self._scene = scene

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts the obstacles into a scene of some size [m]."""
        for each in self._scene.values():
            yield draw_obstacle(each.name, each.shape, 4.0 * size)

    def move(self, time: float) -> Iterator[Command]:
        """Yield what moves them to where they are at a time [s]."""
        for each in self._scene.values():
            yield move_obstacle(each.name, each.placement(time))

    def points(self) -> Array:
        """Return no point: the robot is where the viewer shows it."""
        return np.zeros((0, 3))

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles at the start [m], shape (K, 3)."""
        corners = [
            corner
            for each in self._scene.values()
            for corner in enclosing(each.shape, each.placement(0.0).translation)
        ]
        return np.reshape(corners, (-1, 3))

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
        return obstacle_legend(self._scene)


def _path(name: str) -> str:
    return f"{ROOT}/{element(name)}"
