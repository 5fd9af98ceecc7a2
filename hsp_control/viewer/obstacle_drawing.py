"""Obstacles in the scene: translucent balls that move."""

from collections.abc import Iterator

import numpy as np

from hsp_control.arrays import Array
from hsp_control.scene import Scene
from hsp_control.trajectories import TrajectorySample
from hsp_control.viewer import shapes
from hsp_control.viewer.appearance import OBSTACLE, OBSTACLE_OPACITY
from hsp_control.viewer.commands import Command, set_object, set_transform

ROOT = "/obstacles"


def draw_obstacle(name: str, radius: float) -> Command:
    """Return what puts a ball into the scene; `move_obstacle` gives it its place."""
    surface = shapes.material(OBSTACLE, opacity=OBSTACLE_OPACITY, glow=0.15)
    ball = shapes.mesh(shapes.sphere(radius), surface)
    return set_object(_path(name), shapes.group([ball]))


def move_obstacle(name: str, center: Array) -> Command:
    """Return what moves a ball's centre [m], shape (3,)."""
    pose = np.eye(4)
    pose[:3, 3] = center
    return set_transform(_path(name), pose)


class ObstacleDrawing:
    """The obstacles of a scene, each on its trajectory."""

    def __init__(self, scene: Scene) -> None:
        """Draw this scene."""
        self._scene = scene
        self._sample = TrajectorySample.allocate(3)

    def draw(self) -> Iterator[Command]:
        """Yield what puts the obstacles into the scene."""
        for obstacle in self._scene.values():
            yield draw_obstacle(obstacle.name, obstacle.radius)

    def move(self, time: float) -> Iterator[Command]:
        """Yield what moves them to where they are at a time [s]."""
        for obstacle in self._scene.values():
            center = obstacle.center.sample(time, self._sample).position
            yield move_obstacle(obstacle.name, center)

    def points(self) -> Array:
        """Return points that enclose them at the start [m], shape (K, 3)."""
        corners = [
            obstacle.center.sample(0.0, self._sample).position + sign * obstacle.radius
            for obstacle in self._scene.values()
            for sign in (-1.0, 1.0)
        ]
        return np.array(corners).reshape(-1, 3)

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
        return [(name, OBSTACLE) for name in self._scene]


def _path(name: str) -> str:
    return f"{ROOT}/{name.replace('/', '_')}"
