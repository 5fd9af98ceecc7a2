"""The shapes of a robot that touch the ground: given ones, or those of its links."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import coal
import numpy as np
import pinocchio as pin
from pydantic import AfterValidator

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import Part
from hsp_control.declaration.named import BY_FRAME, stored_by_frame
from hsp_control.declaration.quantities import ArrayField, Vector3
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.geometry import link_shapes
from hsp_control.geometry.capsule_fit import enclosing_capsule
from hsp_control.geometry.hulls import hull_corners
from hsp_control.geometry.shapes import Box, Capsule, Cylinder, Shape, Sphere
from hsp_control.robot import Robot

_MIN_HALF_HEIGHT = 1e-3
"""Half the height of the box for a flat mesh [m]; MuJoCo needs a positive one."""


def supported_shape(shape: Shape) -> Shape:
    """Return a shape that MuJoCo has."""
    if not isinstance(shape, Sphere | Capsule | Cylinder | Box):
        raise ValueError(
            f"{shape.yaml_type} is not possible here; needs a sphere, capsule, "
            "cylinder or box"
        )
    return shape


class ContactShape(Part, error=SimulationError):
    """A shape at a frame that may touch the ground.

    Without a shape it is the collision geometry of the frame's link, or if that has
    none, of all links fixed to it. A mesh with a flat sole is replaced by its box in
    the frame's axes, any other mesh by its capsule, because a robot chatters on the
    corners of a mesh.
    """

    yaml_key: ClassVar[str | None] = "frame"

    frame: str
    """Name of the frame [-]; forces are logged under it. In YAML, its key."""
    shape: Annotated[Shape, AfterValidator(supported_shape)] | None = None
    """The shape [-]; by default made from the link's collision geometry."""
    position: Vector3 = (0.0, 0.0, 0.0)
    """Position of the shape in the frame [m]."""
    rotation: Rotation = (0.0, 0.0, 0.0)
    """Rotation of the shape in the frame: roll, pitch and yaw [rad], a quaternion
    (x, y, z, w) [-], or a matrix [-]."""


ContactShapes = Annotated[
    Sequence[ContactShape],
    ArrayField(dict[str, ContactShape], stored_by_frame),
    BY_FRAME,
]
"""Shapes: a sequence in Python, a mapping by frame in YAML."""


@dataclass(frozen=True)
class Geom:
    """A MuJoCo geom."""

    type: str  # its MuJoCo type
    size: tuple[float, ...]  # its MuJoCo size [m]
    placement: pin.SE3  # its placement in its joint's frame


def geoms_of(robot: Robot, contact: ContactShape) -> list[Geom]:
    """Return the geoms of a contact, placed in the frame of its joint."""
    frame = robot.model.frames[robot.frame_id(contact.frame)]
    if frame.parentJoint == 0:
        raise SimulationError("it is fixed to the world and never moves")
    if contact.shape is not None:
        offset = pin.SE3(matrix_of(contact.rotation), np.asarray(contact.position))
        return [geom_of(contact.shape.geometry(), frame.placement * offset)]
    fixed = [s for s in link_shapes(robot, "meshes") if s.joint == frame.parentJoint]
    own = [s for s in fixed if s.link == contact.frame] or fixed
    # For a robot without any geometry, `link_shapes` invents capsules between joints.
    bodies = {f.name for f in robot.model.frames if f.type == pin.FrameType.BODY}
    real = [s for s in own if s.link in bodies]
    if not real:
        raise SimulationError("no collision geometry is fixed to it; give a shape")
    return [geom_of(s.geometry, s.placement, frame.placement) for s in real]


def geom_of(geometry: Any, place: pin.SE3, frame: pin.SE3 | None = None) -> Geom:
    """Return the geom of Coal's geometry, a mesh as a box in the axes of ``frame``."""
    if isinstance(geometry, coal.Sphere):
        return Geom("sphere", (geometry.radius,), place)
    if isinstance(geometry, coal.Box):
        return Geom("box", tuple(map(float, geometry.halfSide)), place)
    if isinstance(geometry, coal.Capsule):
        return Geom("capsule", (geometry.radius, geometry.halfLength), place)
    if isinstance(geometry, coal.Cylinder):
        return Geom("cylinder", (geometry.radius, geometry.halfLength), place)
    assert frame is not None
    vertices = geometry.vertices if hasattr(geometry, "vertices") else geometry.points
    points = np.array([frame.actInv(place.act(point)) for point in vertices()])
    return _box_of_sole(points, frame) or _capsule(points, frame)


def _box_of_sole(points: Array, frame: pin.SE3) -> Geom | None:
    """Return the bounding box of points that have a flat sole, None for others.

    The sole is flat if the lowest tenth of the height is at least half as long and half
    as wide as the whole.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    sole = points[points[:, 2] <= low[2] + 0.1 * (high[2] - low[2])]
    if (np.ptp(sole[:, :2], axis=0) < 0.5 * (high - low)[:2]).any():
        return None
    middle = pin.SE3(np.eye(3), 0.5 * (low + high))
    half = np.maximum(0.5 * (high - low), _MIN_HALF_HEIGHT)
    return Geom("box", tuple(map(float, half)), frame * middle)


def _capsule(points: Array, frame: pin.SE3) -> Geom:
    first, second, radius = enclosing_capsule(hull_corners(points))
    length = float(np.linalg.norm(second - first))
    if length < 1e-6:
        return Geom("sphere", (radius,), frame * pin.SE3(np.eye(3), first))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), second - first)
    place = pin.SE3(turn.matrix(), 0.5 * (first + second))
    return Geom("capsule", (radius, 0.5 * length), frame * place)
