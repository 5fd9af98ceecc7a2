"""The shapes of a robot's bodies, for sources that are no URDF."""

from dataclasses import dataclass
from typing import Literal

from hsp_control.common.arrays import Array, Indices

ShapeKind = Literal["box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh"]


@dataclass(frozen=True, eq=False)
class BodyShape:
    """A shape that is fixed to a body, as it is seen or as it collides.

    Attributes:
        body: Name of the body's frame.
        kind: What it is.
        size: The lengths of a box, the radius and the length (of a cylinder, of a
            capsule without its ends), the radius of a sphere, the semi-axes of an
            ellipsoid [m]; of a mesh: nothing.
        pose: Its pose in the body's frame, shape (4, 4).
        color: Red, green, blue and opacity, from 0 to 1.
        seen: Whether it is drawn.
        collides: Whether distances and collisions count it.
        mesh: Of a mesh: its vertices [m], shape (k, 3), and triangles of their indices,
            shape (n, 3). What collides is its convex hull.
    """

    body: str
    kind: ShapeKind
    size: tuple[float, ...]
    pose: Array
    color: tuple[float, float, float, float]
    seen: bool
    collides: bool
    mesh: tuple[Array, Indices] | None = None
