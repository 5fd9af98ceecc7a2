"""Obstacles as a log describes them: bodies that move, and what is seen of them."""

from collections.abc import Callable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.visualization.plots.views import View

_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
_DISK = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE)])


class Body(NamedTuple):
    """An obstacle over a run: balls about points that move as one, and their hull.

    One point makes a ball, two a capsule, a box's corners a box; what is not convex is
    shown by its hull.

    Attributes:
        name: Its name.
        center: Where its frame is [m], shape (N, 3).
        rotation: How its frame is turned, world ← body, shape (N, 3, 3).
        points: The points in its frame [m], shape (K, 3); none: a half-space, all below
            its x-y plane.
        radius: The balls' radius [m].
        exact: False for a ball that only holds it.
        vast: Whether it is larger than the robot, such as a floor; pictures need not
            hold all of it.
    """

    name: str
    center: Array
    rotation: Array
    points: Array
    radius: float
    exact: bool
    vast: bool

    @property
    def moves(self) -> bool:
        """Whether it moves or turns."""
        travel = np.ptp(self.center, axis=0).max() + np.ptp(self.rotation, axis=0).max()
        return bool(travel > 1e-9)

    def placed(self, row: int) -> Array:
        """Return its points in the world at a row, shape (K, 3) [m]."""
        return np.asarray(self.center[row] + self.points @ self.rotation[row].T)

    def enclosed(self) -> Array:
        """Return points that enclose it at all rows, shape (M, 3) [m]."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        corners = _corners(low, high) if len(self.points) > 8 else self.points
        turned = corners @ np.swapaxes(self.rotation, 1, 2)  # (N, K, 3)
        placed = (turned + self.center[:, None]).reshape(-1, 3)
        return np.concatenate([placed - self.radius, placed + self.radius])

    def outline(self, view: View, row: int) -> Array:
        """Return its outline on the page at a row, shape (P, 2)."""
        page = np.column_stack(view.project(self.placed(row)))
        least = 1e-4 * float(np.ptp(page, axis=0).max())  # what is seen edge-on
        disk = max(self.radius, least) * _DISK
        cloud = (page[:, None] + disk).reshape(-1, 2)
        return np.asarray(cloud[ConvexHull(cloud).vertices])


def bodies(rollout: Rollout) -> list[Body]:
    """Return the obstacles of the scene."""
    return [
        _body(rollout, name, about)
        for name, about in rollout.meta.get("obstacles", {}).items()
    ]


def _body(rollout: Rollout, name: str, about: Mapping[str, Any]) -> Body:
    center = rollout[f"obstacle.{name}"]
    rotation = np.broadcast_to(np.eye(3), (len(center), 3, 3))
    if f"obstacle.{name}.quaternion" in rollout and len(center):
        turned = Rotation.from_quat(rollout[f"obstacle.{name}.quaternion"])
        rotation = turned.as_matrix()
    form = _FORMS.get(about.get("shape", ""))
    if form is None:
        points, radius = np.zeros((1, 3)), float(about["radius"])
    else:
        points, radius = form(about.get("parameters", {}))
    robot = float(np.ptp(rollout["skeleton"].reshape(-1, 3), axis=0).max())
    size = 2.0 * radius + float(np.ptp(points, axis=0).max()) if len(points) else np.inf
    vast = size > 1.2 * robot
    return Body(name, center, rotation, points, radius, form is not None, vast)


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


_FORMS: dict[str, Callable[[Mapping[str, Any]], tuple[Array, float]]] = {
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
"""Points and radius by shape; what is not here (a mesh) shows as a ball around it."""
