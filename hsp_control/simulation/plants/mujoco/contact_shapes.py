"""What of a robot touches the ground: shapes given, or those of its own links."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.geometry import link_shapes
from hsp_control.geometry.capsule_fit import enclosing_capsule
from hsp_control.geometry.hulls import hull_corners
from hsp_control.geometry.shapes import Box, Capsule, Cylinder, Shape, Sphere
from hsp_control.robot import Robot
from hsp_control.robot.description.combining import placement

_KNOWN = (Box, Capsule, Cylinder, Sphere)
_THINNEST = 1e-3
"""Half the height of the box that a flat mesh becomes [m]; MuJoCo needs some."""


@dataclass(frozen=True)
class ContactShape:
    """What of a frame may touch the ground.

    Attributes:
        frame: A frame of the robot; forces are reported under its name.
        shape: A box, ball, capsule or cylinder; None: the collision geometry of the
            frame's link, or where that has none, of all links fixed to it. A mesh with
            a flat sole becomes its box in the frame's axes, another its capsule: on a
            mesh's own corners a robot chatters.
        position: Of the shape in the frame [m], shape (3,).
        rpy: Its roll, pitch and yaw in the frame [rad].
    """

    frame: str
    shape: Shape | None = None
    position: Sequence[float] = (0.0, 0.0, 0.0)
    rpy: Sequence[float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Refuse a shape that MuJoCo has no counterpart of."""
        if self.shape is not None and not isinstance(self.shape, _KNOWN):
            raise SimulationError(
                f"contact of {self.frame!r}: a {type(self.shape).__name__} cannot "
                "touch the ground; choose a Box, Capsule, Cylinder or Sphere"
            )


@dataclass(frozen=True)
class Geom:
    """A MuJoCo geom.

    Attributes:
        type: Its MuJoCo type.
        size: Its MuJoCo size [m].
        placement: Its placement in its joint's frame.
    """

    type: str
    size: tuple[float, ...]
    placement: pin.SE3


def geoms_of(robot: Robot, contact: ContactShape) -> list[Geom]:
    """Return the geoms that stand for a contact, on its frame's joint.

    Raises:
        FrameNotFoundError: If the robot has no such frame.
        SimulationError: If the frame does not move, or shall have its links' geometry
            and they have none.
    """
    frame = robot.model.frames[robot.frame_id(contact.frame)]
    if frame.parentJoint == 0:
        raise SimulationError(
            f"contact of {contact.frame!r}: it is fixed to the world and never moves"
        )
    if contact.shape is not None:
        offset = placement(contact.position, contact.rpy)
        return [
            _geom(contact.shape.geometry(), frame.placement * offset, frame.placement)
        ]
    every = [s for s in link_shapes(robot, "meshes") if s.joint == frame.parentJoint]
    own = [s for s in every if s.link == contact.frame] or every
    # Of a robot without any geometry, `link_shapes` makes capsules up between joints.
    bodies = {f.name for f in robot.model.frames if f.type == pin.FrameType.BODY}
    real = [s for s in own if s.link in bodies]
    if not real:
        raise SimulationError(
            f"contact of {contact.frame!r}: no collision geometry is fixed to it; "
            "give a shape"
        )
    return [_geom(s.geometry, s.placement, frame.placement) for s in real]


def _geom(geometry: Any, place: pin.SE3, frame: pin.SE3) -> Geom:
    if isinstance(geometry, coal.Sphere):
        return Geom("sphere", (geometry.radius,), place)
    if isinstance(geometry, coal.Box):
        return Geom("box", tuple(map(float, geometry.halfSide)), place)
    if isinstance(geometry, coal.Capsule):
        return Geom("capsule", (geometry.radius, geometry.halfLength), place)
    if isinstance(geometry, coal.Cylinder):
        return Geom("cylinder", (geometry.radius, geometry.halfLength), place)
    vertices = geometry.vertices if hasattr(geometry, "vertices") else geometry.points
    points = np.array([frame.actInv(place.act(point)) for point in vertices()])
    return _box_of_sole(points, frame) or _capsule(points, frame)


def _box_of_sole(points: Array, frame: pin.SE3) -> Geom | None:
    """Return the points' box, if they end below in a flat sole.

    They do if the lowest tenth is at least half as long and as wide as all.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    sole = points[points[:, 2] <= low[2] + 0.1 * (high[2] - low[2])]
    if (np.ptp(sole[:, :2], axis=0) < 0.5 * (high - low)[:2]).any():
        return None
    middle = pin.SE3(np.eye(3), 0.5 * (low + high))
    half = np.maximum(0.5 * (high - low), _THINNEST)
    return Geom("box", tuple(map(float, half)), frame * middle)


def _capsule(points: Array, frame: pin.SE3) -> Geom:
    first, second, radius = enclosing_capsule(hull_corners(points))
    length = float(np.linalg.norm(second - first))
    if length < 1e-6:
        return Geom("sphere", (radius,), frame * pin.SE3(np.eye(3), first))
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), second - first)
    place = pin.SE3(turn.matrix(), 0.5 * (first + second))
    return Geom("capsule", (radius, 0.5 * length), frame * place)
