"""Obstacles' shapes as three.js objects, from a scene or from a log."""

from collections.abc import Mapping
from itertools import product
from typing import Any

import coal
import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import SceneError
from hsp_control.geometry import shapes
from hsp_control.geometry.shapes import Shape, shape_from_log
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import OBSTACLE, OBSTACLE_OPACITY
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.threejs import material, pose_at

_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def logged_shape(about: Mapping[str, Any]) -> Shape | None:
    """Return the shape that a log describes, or its bounding ball, or None."""
    try:
        shape = shape_from_log(str(about.get("shape")), about.get("parameters", {}))
        if shape is not None:
            shape.geometry()  # raises if a mesh's file no longer exists
            return shape
    except SceneError:
        pass
    radius = about.get("radius")
    return None if radius is None else shapes.Sphere(float(radius))


def obstacle(shape: Shape, extent: float, color: str = OBSTACLE) -> Json:
    """Return a shape as a three.js object."""
    surface = material(color, opacity=OBSTACLE_OPACITY, glow=0.3)
    pose = np.eye(4)
    match shape:
        case shapes.Sphere():
            solid = threejs.sphere(shape.radius)
        case shapes.Capsule():
            solid = threejs.capsule(shape.length, shape.radius, shape.radius)
            pose = pose_at([0.0, 0.0, -0.5 * shape.length])
        case shapes.Cylinder():
            solid = threejs.cylinder(shape.radius, shape.length)
        case shapes.Box():
            solid = threejs.box(np.asarray(shape.size).tolist())
        case shapes.HalfSpace():
            solid = threejs.plane(extent)
            surface |= {"opacity": 0.3 * OBSTACLE_OPACITY, "side": 2}
        case shapes.PointCloud():
            solid = facets(*_cubes(np.asarray(shape.points), shape.resolution))
        case _:
            solid = facets(*triangles_of(shape.geometry()))
            surface |= {"side": 2}
    thing = threejs.mesh(solid, surface, pose)
    thing["object"]["receiveShadow"] = False  # its own would show through
    if isinstance(shape, shapes.HalfSpace):
        thing["object"]["castShadow"] = (
            False  # the drawn square ends, the half-space does not
        )
    return threejs.group([thing])


def facets(vertices: Array, triangles: Indices) -> Json:
    """Return flat-shaded triangles: each has its own vertices and normal."""
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0.0, lengths, 1.0)
    return threejs.buffer_geometry(
        {"position": corners.reshape(-1, 3), "normal": np.repeat(normals, 3, axis=0)}
    )


def _cubes(points: Array, edge: float) -> tuple[Array, Indices]:
    vertices = points[:, None, :] + edge * _CORNERS
    triangles = 8 * np.arange(len(points))[:, None, None] + _FACES
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def triangles_of(geometry: Any) -> tuple[Array, Indices]:
    """Return vertices (n, 3) and triangles (k, 3) of Coal's mesh or convex hull."""
    if isinstance(geometry, coal.BVHModelBase):
        vertices, count, triangle = (
            geometry.vertices(),
            geometry.num_tris,
            geometry.tri_indices,
        )
    else:
        vertices, count, triangle = (
            geometry.points(),
            geometry.num_polygons,
            geometry.polygons,
        )
    indices = [[triangle(k)[i] for i in range(3)] for k in range(count)]
    return np.array(vertices), np.array(indices, dtype=np.int64)
