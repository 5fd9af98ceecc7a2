"""Writes a Pinocchio model as MJCF.

It uses the Pinocchio model and not the URDF, so that locked joints, added parts and
changed inertias are the same in MuJoCo.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.friction import JointFriction
from hsp_control.robot.mujoco_coordinates import (
    CONTINUOUS,
    FREE,
    HINGE,
    PLANAR,
    SLIDE,
    SPHERICAL,
    Joint,
)
from hsp_control.simulation.plants.mujoco.contact_shapes import Geom
from hsp_control.simulation.plants.mujoco.ground import Ground
from hsp_control.simulation.plants.mujoco.solids import Solid

MIN_INERTIA = 1e-12
"""Smallest mass and inertia of a body [kg, kg·m²]; MuJoCo needs positive ones."""

_OWN_IMPEDANCE = 0.95
"""MuJoCo's own impedance of contacts, where they are deep."""
_CONTACT, _GROUND, _LOOSE = 1, 2, 3  # kinds of geoms
_COLLIDES = {_CONTACT: _GROUND, _GROUND: _CONTACT, _LOOSE: _LOOSE}
"""With which kinds each collides, bit by bit; what is loose with all."""


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
            element.set("priority", "1")  # its friction counts, not the other's
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
    principal, axes = np.linalg.eigh(inertia.inertia)
    axes[:, 2] *= np.linalg.det(axes)  # a rotation
    inertial = SubElement(
        body, "inertial", mass=_numbers([max(inertia.mass, MIN_INERTIA)])
    )
    _place(inertial, pin.SE3(axes, inertia.lever))
    inertial.set("diaginertia", _numbers(np.maximum(principal, MIN_INERTIA)))
    return body


def _joint_elements(joint: Joint) -> list[tuple[str, dict[str, str]]]:
    """Return tag and attributes of each MuJoCo joint that represents a joint."""
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
    """Add a contact that has its own damping of a slip; MuJoCo's own is left out."""
    mu = of.friction
    pair = SubElement(pairs, "pair", geom1=solid, geom2=shape, condim="3")
    pair.set("friction", _numbers([mu, mu, 0.0, 0.0, 0.0]))
    # Negative numbers are stiffness, which friction has not, and damping, which MuJoCo
    # divides by the impedance.
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
