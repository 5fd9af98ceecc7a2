"""The shapes of a robot's bodies, for sources that are no URDF."""

from dataclasses import dataclass
from typing import Literal

from hsp_control.common.arrays import Array, Indices

ShapeKind = Literal["box", "sphere", "capsule", "cylinder", "ellipsoid", "mesh"]


@dataclass(frozen=True, eq=False)
class BodyShape:
    """A shape that is fixed to a body, as it is seen or as it collides."""

    body: str  # name of the body's frame
    kind: ShapeKind  # what it is
    # the lengths of a box, the radius and the length (of a cylinder, of a capsule
    # without its ends), the radius of a sphere, the semi-axes of an ellipsoid [m]; of a
    # mesh: nothing
    size: tuple[float, ...]
    pose: Array  # its pose in the body's frame, shape (4, 4)
    # red, green, blue and opacity, from 0 to 1
    color: tuple[float, float, float, float]
    seen: bool  # whether it is drawn
    collides: bool  # whether distances and collisions count it
    # of a mesh: its vertices [m], shape (k, 3), and triangles of their indices, shape
    # (n, 3). What collides is its convex hull
    mesh: tuple[Array, Indices] | None = None
