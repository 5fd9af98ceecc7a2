"""Zones of influence: the shell around an obstacle in which the field acts."""

from collections.abc import Iterator
from itertools import product
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.geometry import shapes
from hsp_control.geometry.hulls import hull_corners
from hsp_control.geometry.scene import Obstacle
from hsp_control.geometry.shapes import Shape
from hsp_control.null_space.fields import ObstacleClearance
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import OBSTACLE, ZONE_OPACITY
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, Json, set_object
from hsp_control.visualization.viewer.controller_analysis import terms_of_type
from hsp_control.visualization.viewer.legend import LegendEntry, translucent
from hsp_control.visualization.viewer.materials import material
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.obstacle_layer import obstacle_tracks
from hsp_control.visualization.viewer.obstacle_shapes import facets, triangles_of
from hsp_control.visualization.viewer.poses import pose_at
from hsp_control.visualization.viewer.scene_path import path_element

_SWATCH_OPACITY = 0.35
"""Opacity of its colour in the legend: as pale as the zone would be invisible."""


class Influence:
    """The zone of influence of each obstacle of a clearance field."""

    def __init__(self, field: Any, shown: dict[str, Shape], root: str) -> None:
        """Find the zones of influence."""
        self._root = root
        self._zones: dict[str, tuple[Shape, float]] = {}
        for term in terms_of_type(field, ObstacleClearance):
            for obstacle in term.obstacles or ():
                if isinstance(obstacle, Obstacle) and obstacle.name in shown:
                    name, shape = obstacle.name, obstacle.shape
                    known = self._zones.get(name, (shape, 0.0))[1]
                    self._zones[name] = shape, max(known, term.influence)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for name, (shape, influence) in self._zones.items():
            yield set_object(self._path(name), zone(shape, influence, 4.0 * size))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        for name in self._zones:
            yield from obstacle_tracks(self._path(name), name, motion)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries: one for each distance at which a zone begins."""
        reaches = sorted({reach for _, reach in self._zones.values()})
        color = translucent(OBSTACLE, _SWATCH_OPACITY)
        return [
            LegendEntry(
                f"influence zone {reach:g} m",
                color,
                tuple(
                    self._path(name)
                    for name, (_, own) in self._zones.items()
                    if own == reach
                ),
            )
            for reach in reaches
        ]

    def _path(self, name: str) -> str:
        return f"{self._root}/{path_element(name)}"


def zone(shape: Shape, influence: float, extent: float) -> Json:
    """Return the surface at a distance [m] from a shape's convex hull, for three.js."""
    # Only its back faces are drawn: it never covers the robot.
    surface = material(OBSTACLE, opacity=ZONE_OPACITY, glow=0.6) | {"side": 1}
    pose = np.eye(4)
    match shape:
        case shapes.Sphere():
            solid = threejs.sphere(shape.radius + influence)
        case shapes.Capsule():
            radius = shape.radius + influence
            solid = threejs.capsule(shape.length, radius, radius)
            pose = pose_at([0.0, 0.0, -0.5 * shape.length])
        case shapes.Cylinder():
            solid = threejs.rounded_cylinder(
                shape.radius + influence, shape.length + 2.0 * influence, influence
            )
        case shapes.HalfSpace():
            solid = threejs.plane(extent)
            pose = pose_at([0.0, 0.0, influence])
            surface |= {"side": 2, "opacity": 0.5 * ZONE_OPACITY}
        case shapes.Box():
            corners = np.array(list(product((-0.5, 0.5), repeat=3)))
            solid = _rounded(corners * np.asarray(shape.size), influence)
        case shapes.PointCloud():
            solid = _rounded(np.asarray(shape.points), influence)
        case _:
            solid = _rounded(triangles_of(shape.geometry())[0], influence)
    return threejs.group([threejs.mesh(solid, surface, pose, shadow=False)])


def _rounded(points: Array, distance: float) -> Json:
    """Return the convex hull of balls around points; points (K, 3) [m]."""
    from scipy.spatial import ConvexHull  # here: SciPy takes long to import

    cloud = (hull_corners(points)[:, None, :] + distance * _unit_sphere()).reshape(
        -1, 3
    )
    hull = ConvexHull(cloud)
    corners = hull.points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles = hull.simplices.astype(np.int64)
    triangles[inward] = triangles[inward, ::-1]
    return facets(hull.points, triangles)


def _unit_sphere() -> Array:
    """Return evenly spread points on the unit sphere, shape (200, 3)."""
    k = np.arange(200) + 0.5
    height, turn = 1.0 - k / 100.0, np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
