"""The geometry in a log: skeleton, paths of the tasks, and obstacles."""

from collections.abc import Callable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import TaskPath, task_names, task_path
from hsp_control.visualization.plots.views import View

_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
_DISK = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE)])


class LoggedObstacle(NamedTuple):
    """An obstacle during a run: the convex hull of balls around moving points."""

    name: str
    center: Array  # the origin of its frame [m], (N, 3)
    rotation: Array  # the rotation of its frame, world ← obstacle, (N, 3, 3)
    # The points in its frame [m], (K, 3); K = 0: a half-space, below its x-y plane.
    points: Array
    radius: float  # the balls' radius [m]
    exact: bool  # false if only a bounding ball is known
    # Whether it is larger than the robot, such as a floor; figures need not show all of
    # it.
    oversized: bool

    @property
    def moves(self) -> bool:
        """Whether it translates or rotates."""
        travel = np.ptp(self.center, axis=0).max() + np.ptp(self.rotation, axis=0).max()
        return bool(travel > 1e-9)

    def world_points(self, row: int) -> Array:
        """Return its points in the world at a row [m], shape (K, 3)."""
        return np.asarray(self.center[row] + self.points @ self.rotation[row].T)

    def enclosing_points(self) -> Array:
        """Return points that enclose it at all rows [m], shape (M, 3)."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        corners = _corners(low, high) if len(self.points) > 8 else self.points
        rotated = corners @ np.swapaxes(self.rotation, 1, 2)  # (N, K, 3)
        placed = (rotated + self.center[:, None]).reshape(-1, 3)
        return np.concatenate([placed - self.radius, placed + self.radius])

    def outline(self, view: View, row: int) -> Array:
        """Return its outline in the view's plane at a row [m], shape (P, 2)."""
        page = np.column_stack(view.project(self.world_points(row)))
        # A flat shape, seen edge-on.
        thinnest = 1e-4 * float(np.ptp(page, axis=0).max())
        disk = max(self.radius, thinnest) * _DISK
        cloud = (page[:, None] + disk).reshape(-1, 2)
        return np.asarray(cloud[ConvexHull(cloud).vertices])


def logged_obstacles(rollout: Rollout) -> list[LoggedObstacle]:
    """Return the obstacles of a log."""
    return [
        _logged_obstacle(rollout, name, about)
        for name, about in rollout.meta.get("obstacles", {}).items()
    ]


def _logged_obstacle(
    rollout: Rollout, name: str, about: Mapping[str, Any]
) -> LoggedObstacle:
    center = rollout[f"obstacle.{name}"]
    rotation = np.broadcast_to(np.eye(3), (len(center), 3, 3))
    if f"obstacle.{name}.quaternion" in rollout and len(center):
        orientation = Rotation.from_quat(rollout[f"obstacle.{name}.quaternion"])
        rotation = orientation.as_matrix()
    points_of = _POINTS_OF_SHAPE.get(about.get("shape", ""))
    if points_of is None:
        points, radius = np.zeros((1, 3)), float(about["radius"])
    else:
        points, radius = points_of(about.get("parameters", {}))
    robot_size = float(np.ptp(rollout["skeleton"].reshape(-1, 3), axis=0).max())
    size = 2.0 * radius + float(np.ptp(points, axis=0).max()) if len(points) else np.inf
    oversized = size > 1.2 * robot_size
    return LoggedObstacle(
        name, center, rotation, points, radius, points_of is not None, oversized
    )


def _corners(low: Array, high: Array) -> Array:
    return np.array(list(product(*np.stack([low, high]).T)))


def _capsule(about: Mapping[str, Any]) -> tuple[Array, float]:
    end = np.array([0.0, 0.0, 0.5 * float(about["length"])])
    return np.stack([-end, end]), float(about["radius"])


def _cylinder(about: Mapping[str, Any]) -> tuple[Array, float]:
    ring = float(about["radius"]) * _DISK
    half = np.full((len(ring), 1), 0.5 * float(about["length"]))
    return np.concatenate([np.hstack([ring, -half]), np.hstack([ring, half])]), 0.0


def _box(about: Mapping[str, Any]) -> tuple[Array, float]:
    half = 0.5 * np.asarray(about["size"], dtype=float)
    return _corners(-half, half), 0.0


def _height_field(about: Mapping[str, Any]) -> tuple[Array, float]:
    heights = np.asarray(about["heights"], dtype=float)
    half = 0.5 * np.asarray(about["size"], dtype=float)
    low = np.array([*-half, heights.min()])
    return _corners(low, np.array([*half, heights.max()])), 0.0


_POINTS_OF_SHAPE: dict[str, Callable[[Mapping[str, Any]], tuple[Array, float]]] = {
    "Sphere": lambda about: (np.zeros((1, 3)), float(about["radius"])),
    "Capsule": _capsule,
    "Cylinder": _cylinder,
    "Box": _box,
    "HeightField": _height_field,
    "PointCloud": lambda about: (
        np.asarray(about["points"], dtype=float),
        0.5 * float(about["resolution"]),
    ),
    "HalfSpace": lambda about: (np.zeros((0, 3)), 0.0),
}
"""Returns points and radius by shape; others, as a mesh, are drawn as a ball."""


def parents(rollout: Rollout) -> list[int]:
    """Return the index of every skeleton point's parent, -1 for none."""
    return [int(parent) for parent in rollout.meta["robot"]["skeleton_parents"]]


def task_paths(rollout: Rollout) -> list[TaskPath]:
    """Return the paths of all tasks that control a point."""
    paths = (task_path(rollout, name) for name in task_names(rollout))
    return [path for path in paths if path is not None]


def end_points(rollout: Rollout) -> Array:
    """Return the paths of the skeleton's ends [m], shape (N, ends, 3)."""
    inner = set(parents(rollout))
    ends = [k for k in range(rollout["skeleton"].shape[1]) if k not in inner]
    return rollout["skeleton"][:, ends]


def enclosing_points(rollout: Rollout) -> Array:
    """Return points that enclose robot, paths and obstacles [m], shape (K, 3)."""
    around = [
        obstacle.enclosing_points()
        for obstacle in logged_obstacles(rollout)
        if not obstacle.oversized
    ]
    return np.concatenate([*_robot_and_paths(rollout), *around])


def center_points(rollout: Rollout) -> Array:
    """Return points of robot and paths, and the obstacles' centres [m], shape (K, 3).

    They lie in a plane if all motion does; the obstacles' size does not matter.
    """
    middles = [
        obstacle.center
        for obstacle in logged_obstacles(rollout)
        if not obstacle.oversized
    ]
    return np.concatenate([*_robot_and_paths(rollout), *middles])


def _robot_and_paths(rollout: Rollout) -> list[Array]:
    paths = task_paths(rollout)
    return [rollout["skeleton"].reshape(-1, 3), *(path.desired for path in paths)]
