"""The MJCF of a robot and its environment: contact shapes, ground and solids."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import Annotated, Any, ClassVar
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import coal
import numpy as np
import pinocchio as pin
from pydantic import AfterValidator, Field

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.companions.mujoco.coordinates import (
    CONTINUOUS,
    FREE,
    HINGE,
    PLANAR,
    SLIDE,
    SPHERICAL,
    Joint,
)
from hsp_control.declaration import Part
from hsp_control.declaration.nested import BY_FRAME, BY_NAME, stored, stored_by_frame
from hsp_control.declaration.quantities import (
    ArrayField,
    Name,
    NonNegative,
    Number,
    Positive,
    PositiveCount,
    ProperFraction,
    Vector3,
)
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.geometry import link_shapes
from hsp_control.geometry.enclosing import enclosing_capsule, hull_corners
from hsp_control.geometry.shapes import Box, Capsule, Cylinder, Shape, Sphere
from hsp_control.robot import Robot
from hsp_control.robot.friction import JointFriction


class Ground(Part, error=SimulationError):
    """A horizontal floor."""

    height: Number = 0.0
    """Height of the floor above the world's origin [m]."""
    friction: NonNegative = 0.8
    """Coulomb friction coefficient of the floor [-]."""


_MIN_HALF_HEIGHT = 1e-3
"""Half the height of the box for a flat mesh [m]; MuJoCo needs a positive one."""


def supported_shape(shape: Shape) -> Shape:
    """Return a shape that MuJoCo supports."""
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
    # For a robot without any geometry, `link_shapes` returns capsules between joints.
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
    """Return the bounding box of points that have a flat sole, None for others."""
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


class Solid(Part, error=SimulationError):
    """A fixed body: a wall, a table, a slope; with copies, stairs; a loose one: a box.

    The robot touches it with the shapes that the plant's ``contacts`` declare. A loose
    solid also touches the ground and the other solids.

    MuJoCo's friction is soft: it damps the slip u at the rate b, until the friction
    cone limits the force. A shape that continues to slide is accelerated away from the
    surface by μ b ‖u‖, since the cone's dual couples the two. The surface supplies (1 -
    d)/d of the acceleration with which the shape is pressed; if that is less, the
    contact chatters. With ``slip_damping`` b and ``impedance`` d shapes slide by
    Coulomb's law, see ``docs/forces.md``.
    """

    yaml_key: ClassVar[str | None] = "name"

    name: Name
    """Its name in the log [-]; in YAML, its key."""
    shape: Annotated[Shape, AfterValidator(supported_shape)]
    """Its shape: a box, sphere, cylinder or capsule [-]."""
    position: Vector3 = (0.0, 0.0, 0.0)
    """Position of its middle in the world, at the start if it is loose [m]."""
    rotation: Rotation = (0.0, 0.0, 0.0)
    """Its rotation, likewise: roll, pitch and yaw [rad], a quaternion (x, y, z, w)
    [-], or a matrix [-]."""
    _: KW_ONLY
    mass: Positive | None = None
    """Mass of a loose body, evenly distributed [kg]; it is fixed by default."""
    friction: NonNegative = 0.8
    """Coulomb friction coefficient of its surface [-]; it replaces the ground's."""
    slip_damping: Positive | None = None
    """Rate b at which MuJoCo's friction stops a slip [1/s]; MuJoCo's own by default,
    about 100. The smaller it is, the faster sticking shapes creep."""
    impedance: ProperFraction | None = None
    """MuJoCo's impedance d of the surface [-]; its own by default, 0.9 to 0.95. The
    smaller it is, the deeper shapes penetrate."""
    copies: PositiveCount = 1
    """Number of copies in a row [-]: the steps of stairs."""
    spacing: Vector3 = (0.0, 0.0, 0.0)
    """Displacement from each copy to the next, in the world [m]."""

    def __post_init__(self) -> None:
        if self.copies > 1 and not np.any(np.asarray(self.spacing)):
            raise SimulationError(
                f"{self.copies} copies have the spacing [0, 0, 0]; give another one"
            )

    @property
    def push_off(self) -> float:
        """μ b d/(1 - d) [1/s], with MuJoCo's own b and d where they are not given."""
        d, b = self.impedance or _OWN_IMPEDANCE, self.slip_damping or _OWN_SLIP_DAMPING
        return d / (1.0 - d) * self.friction * b

    def geoms(self) -> list[tuple[str, Geom]]:
        """Return the geoms with their names, placed in the world."""
        rotation = matrix_of(self.rotation)
        first, spacing = np.asarray(self.position), np.asarray(self.spacing)
        return [
            (
                f"solid/{self.name}/{k}",
                geom_of(self.shape.geometry(), pin.SE3(rotation, first + k * spacing)),
            )
            for k in range(self.copies)
        ]


Solids = Annotated[
    Sequence[Solid],
    ArrayField(Annotated[dict[Name, Solid], Field(max_length=100)], stored),
    BY_NAME,
]
"""Solids: a sequence in Python, a mapping by name in YAML."""


MIN_INERTIA = 1e-12
"""Smallest mass and inertia of a body [kg, kg·m²]; MuJoCo needs positive ones."""

_OWN_IMPEDANCE, _OWN_SLIP_DAMPING = 0.95, 100.0
"""MuJoCo's own impedance of deep contacts, and damping of slip [1/s]."""
_CONTACT, _GROUND, _LOOSE = 1, 2, 3  # kinds of geoms
_COLLIDES = {_CONTACT: _GROUND, _GROUND: _CONTACT, _LOOSE: _LOOSE}
"""Bit mask of the kinds with which each collides; loose solids collide with all."""


def write_mjcf(
    robot: Robot,
    joints: Sequence[Joint],
    *,
    integrator: str,
    joint_limits: bool,
    friction: JointFriction | None,
    geoms: Mapping[int, Sequence[tuple[str, Geom]]],
    ground: Ground,
    solids: Sequence[Solid] = (),
) -> str:
    """Return the MJCF text."""
    root = Element("mujoco", model=robot.name)
    SubElement(root, "compiler", angle="radian", autolimits="false")
    options = {
        "gravity": _numbers(robot.model.gravity.linear),
        "integrator": integrator,
        "cone": "elliptic",
        "impratio": "10",  # stiffer friction than by default: feet do not creep
    }
    flags = SubElement(SubElement(root, "option", options), "flag")
    flags.set("autoreset", "disable")  # a run that diverges is an error, not a restart
    world = SubElement(root, "worldbody")
    if geoms:
        place = pin.SE3(np.eye(3), np.array([0.0, 0.0, ground.height]))
        plane = Geom("plane", (0.0, 0.0, 1.0), place)
        _add_geom(world, "ground", plane, ground.friction, _GROUND)
    loose: dict[str, Element] = {}
    for solid in solids:
        for name, geom in solid.geoms():
            kind = _GROUND if solid.mass is None else _LOOSE
            parent = world
            if solid.mass is not None:
                parent = loose[name] = Element("body", name=name)
                _place(parent, geom.placement)
                SubElement(parent, "freejoint", name=name)
                geom = replace(geom, placement=pin.SE3.Identity())
            element = _add_geom(parent, name, geom, solid.friction, kind)
            element.set("mass", _numbers([solid.mass or 0.0]))
            element.set(
                "priority", "1"
            )  # its friction is used, not that of the other geom
            _set_impedance(element, solid)
    lower, upper = robot.position_limits()
    bodies = {0: world}
    for joint in joints:
        body = _add_body(bodies[robot.model.parents[joint.index]], robot, joint)
        bodies[joint.index] = body
        elements = [SubElement(body, *form) for form in _joint_elements(joint)]
        if joint.leader is None and joint.kind != FREE:
            for k, element in enumerate(elements):
                _set_armature_and_friction(element, robot, friction, joint.v + k)
        if joint_limits and joint.kind in (HINGE, SLIDE) and joint.leader is None:
            limits = [lower[joint.v], upper[joint.v]]
            if np.isfinite(limits).all():
                elements[0].set("limited", "true")
                elements[0].set("range", _numbers(limits))
        for name, geom in geoms.get(joint.index, ()):
            _add_geom(body, name, geom, ground.friction, _CONTACT)
    world.extend(loose.values())  # after the robot, whose coordinates come first
    ties = SubElement(root, "equality")
    for joint in joints:
        if joint.leader is not None:
            tie = SubElement(ties, "joint", joint1=joint.name, joint2=joint.leader.name)
            tie.set("polycoef", _numbers([joint.offset, joint.scaling, 0.0, 0.0, 0.0]))
    slippery = [solid for solid in solids if solid.slip_damping is not None]
    if slippery:
        pairs = SubElement(root, "contact")
        shapes = [name for each in geoms.values() for name, _ in each]
        for solid in slippery:
            for name, _ in solid.geoms():
                for shape in shapes:
                    _add_pair(pairs, name, shape, solid)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode")


def _add_body(parent: Element, robot: Robot, joint: Joint) -> Element:
    body = SubElement(parent, "body", name=joint.name)
    _place(body, robot.model.jointPlacements[joint.index])
    inertia = robot.model.inertias[joint.index]
    principal, axes = principal_inertia(inertia.inertia)
    inertial = SubElement(
        body, "inertial", mass=_numbers([max(inertia.mass, MIN_INERTIA)])
    )
    _place(inertial, pin.SE3(axes, inertia.lever))
    inertial.set("diaginertia", _numbers(principal))
    return body


def principal_inertia(inertia: Array) -> tuple[Array, Array]:
    """Return the principal inertias that MuJoCo accepts, and their axes.

    Args:
        inertia: Inertia about the centre of mass, shape (3, 3) [kg·m²].

    Returns:
        The inertias, shape (3,), and a rotation with the axes as columns.
    """
    principal, axes = np.linalg.eigh(inertia)
    axes[:, 2] *= np.linalg.det(axes)  # a rotation
    return np.maximum(principal, MIN_INERTIA), axes


def _joint_elements(joint: Joint) -> list[tuple[str, dict[str, str]]]:
    """Return tags and attributes of the MuJoCo joints that represent a joint."""
    if joint.kind == FREE:
        return [("freejoint", {"name": joint.name})]
    if joint.kind == SPHERICAL:
        return [("joint", {"name": joint.name, "type": "ball"})]
    if joint.kind == PLANAR:
        motions = [("slide", "1 0 0"), ("slide", "0 1 0"), ("hinge", "0 0 1")]
        return [
            ("joint", {"name": name, "type": kind, "axis": axis})
            for name, (kind, axis) in zip(joint.mujoco_names, motions, strict=True)
        ]
    kind = "hinge" if joint.kind in (HINGE, CONTINUOUS) else "slide"
    axis = _numbers(joint.axis)
    return [("joint", {"name": joint.name, "type": kind, "axis": axis})]


def _set_armature_and_friction(
    element: Element, robot: Robot, friction: JointFriction | None, dof: int
) -> None:
    element.set("armature", _numbers([robot.model.armature[dof]]))
    if friction is not None:
        element.set("damping", _numbers([friction.viscous[dof]]))
        element.set("frictionloss", _numbers([friction.coulomb[dof]]))
        element.set("solreffriction", "0.002 1")
        element.set("solimpfriction", "0.999 0.999 0.001 0.5 2")


def _add_pair(pairs: Element, solid: str, shape: str, of: Solid) -> None:
    """Add a contact with its own damping of slip instead of MuJoCo's."""
    mu = of.friction
    pair = SubElement(pairs, "pair", geom1=solid, geom2=shape, condim="3")
    pair.set("friction", _numbers([mu, mu, 0.0, 0.0, 0.0]))
    # Negative numbers are stiffness, which friction does not have, and damping, which
    # MuJoCo divides by the impedance.
    assert of.slip_damping is not None
    scale = _OWN_IMPEDANCE if of.impedance is None else of.impedance
    pair.set("solreffriction", _numbers([-1.0, -of.slip_damping * scale]))
    _set_impedance(pair, of)


def _set_impedance(element: Element, of: Solid) -> None:
    if of.impedance is not None:
        d = of.impedance
        element.set("solimp", _numbers([d, d, 0.001, 0.5, 2.0]))


def _add_geom(body: Element, name: str, geom: Geom, mu: float, kind: int) -> Element:
    element = SubElement(body, "geom", name=name, type=geom.type)
    element.set("size", _numbers(geom.size))
    _place(element, geom.placement)
    element.set("friction", _numbers([mu, 0.0, 0.0]))
    element.set("contype", str(kind))
    element.set("conaffinity", str(_COLLIDES[kind]))
    element.set("mass", "0")
    return element


def _place(element: Element, placement: pin.SE3) -> None:
    x, y, z, w = pin.Quaternion(placement.rotation).coeffs()
    element.set("pos", _numbers(placement.translation))
    element.set("quat", _numbers([w, x, y, z]))


def _numbers(values: Array | Sequence[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
