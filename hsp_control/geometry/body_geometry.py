"""Coal's geometries of the shapes that a robot's source gives without a URDF."""

from typing import Any

import coal
import numpy as np
import pinocchio as pin

from hsp_control.geometry.hulls import convex_hull
from hsp_control.robot.description.body_shape import BodyShape


def body_geometry(shape: BodyShape) -> Any:
    """Return Coal's geometry; of a mesh its convex hull, or a flat mesh as it is."""
    match shape.kind:
        case "box":
            return coal.Box(*shape.size)
        case "sphere":
            return coal.Sphere(*shape.size)
        case "capsule":
            return coal.Capsule(*shape.size)
        case "cylinder":
            return coal.Cylinder(*shape.size)
        case "ellipsoid":
            return coal.Ellipsoid(*shape.size)
    assert shape.mesh is not None
    vertices, triangles = shape.mesh
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(vertices))
    for triangle in vertices[triangles]:
        mesh.addTriangle(*triangle)
    mesh.endModel()
    return convex_hull(mesh) or mesh


def enclosing_ellipsoid_capsule(ellipsoid: Any) -> tuple[pin.SE3, float, float]:
    """Return pose (axis along z), radius and length of an ellipsoid's least capsule.

    With semi-axes a ≥ b ≥ c, it lies along the first, with the radius b and the length
    2 (a - b): at its ends the ellipsoid is more curved than a sphere of radius b.
    """
    radii = np.asarray(ellipsoid.radii, dtype=float)
    shortest, middle, longest = np.argsort(radii, kind="stable")
    axes = np.eye(3)[:, [shortest, middle, longest]]
    axes[:, 0] *= np.linalg.det(axes)  # a rotation
    radius = float(radii[middle])
    return pin.SE3(axes, np.zeros(3)), radius, 2.0 * (float(radii[longest]) - radius)
