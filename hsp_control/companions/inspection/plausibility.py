"""Values that no robot has, as after a confusion of units.

A link's radius of gyration is k = √(½ tr(I)/m), the mean distance of its mass from its
centre. It is no larger than the link, and no smaller than that of a ball of the densest
metal.
"""

from collections.abc import Iterator, Mapping
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError
from hsp_control.companions.inspection.finding import Finding
from hsp_control.geometry import link_shapes
from hsp_control.geometry.mesh_loading import load_mesh
from hsp_control.robot import Robot
from hsp_control.robot.description.inertias import tensor_of
from hsp_control.robot.description.mesh_files import find_file, find_problem
from hsp_control.robot.description.sources import RobotSource

_REACH = 0.01, 30.0
"""Plausible range of a robot's longest chain [m]."""
_WIDE, _LEAST_WIDE = 3.0, 0.3
"""Maximum k, as a share of the distance from a link's centre to its farthest known
point, and of the robot's size: for links without a shape, few points are known."""
_DENSITY = 2.3e4
"""Density of osmium and iridium [kg/m³]."""
_DENSE = 10.0
"""A link may be denser by this factor: small links have rough inertias."""
_HEAVY = 2000.0
"""Largest mass over the cube of the robot's size [kg/m³]; an arm has 10."""
_TURNS = 30.0
"""Maximum limit of a revolute joint that is a limit [rad]; 1e3 and more means none."""


_DRIVEN = {"revolute", "continuous", "prismatic"}
_FAST = 50.0
"""Maximum speed of a robot's joint [rad/s]; 1e3 and more means none."""
_STRONG = 1e6
"""Maximum effort of a robot's joint [N·m or N]."""
_SCALED = 100.0
"""Factor between the sizes of two meshes of a link from which one has another unit."""


def check_size(robot: Robot) -> Iterator[Finding]:
    """Yield a finding if the robot is too long, short, or heavy for its length."""
    low, high = _REACH
    if not low <= robot.size <= high and robot.size > 0.0:
        yield Finding(
            "warning",
            "units",
            "all joints",
            f"the longest chain of joints is {robot.size:.3g} m",
            "lengths of a URDF are in m: are these in "
            f"{'mm' if robot.size > high else 'another unit'}?",
        )
        return
    mass = float(pin.computeTotalMass(robot.model))
    if mass > _HEAVY * robot.size**3 > 0.0:
        yield Finding(
            "warning",
            "units",
            "all links",
            f"{mass:.4g} kg move, on a chain of {robot.size:.3g} m",
            "masses of a URDF are in kg: are these in g?",
        )


def check_gyration(
    xml: Element, robot: Robot, shapes: Mapping[str, Array]
) -> Iterator[Finding]:
    """Yield the links whose radius of gyration is larger or smaller than possible.

    Args:
        xml: The URDF.
        robot: The robot; inertias of links that do not move are ignored.
        shapes: Points of the links' shapes in their frames, shapes (k, 3) [m].
    """
    moving = {f.name for f in robot.model.frames if f.parentJoint > 0}
    known = _known_points(xml)
    total = sum(float(mass.get("value", 0.0)) for mass in xml.iter("mass"))
    for link in xml.findall("link"):
        name = link.get("name", "")
        found = link.find("inertial/mass"), link.find("inertial/inertia")
        mass = 0.0 if found[0] is None else float(found[0].get("value", 0.0))
        if mass <= 1e-4 * total or found[1] is None or name not in moving:
            continue
        trace = float(np.trace(tensor_of(found[1])))
        if trace <= 0.0:  # a point
            continue
        k = float(np.sqrt(0.5 * trace / mass))
        center = _xyz(link.find("inertial/origin"))
        points = np.vstack([known[name], shapes.get(name, np.zeros((0, 3)))])
        away = float(np.linalg.norm(points - center, axis=1).max())
        about = f"{mass:.3g} kg with a radius of gyration of {k:.3g} m"
        # a ball of radius r has k² = 3/5 r²
        volume = 4.0 / 3.0 * np.pi * (k / np.sqrt(0.6)) ** 3
        if k > max(_WIDE * away, _LEAST_WIDE * robot.size):
            yield Finding(
                "warning",
                "units",
                f"link {name!r}",
                f"{about}, but it ends {away:.3g} m from its centre of mass",
                "inertias of a URDF are in kg·m²: are they in another unit or made up?",
            )
        elif mass > _DENSE * _DENSITY * volume:
            yield Finding(
                "warning",
                "units",
                f"link {name!r}",
                f"{about} is {mass / volume:.2g} kg/m³, denser than any metal",
                "masses of a URDF are in kg and inertias in kg·m²: is one in another "
                "unit, or made up?",
            )


def check_angles(xml: Element) -> Iterator[Finding]:
    """Yield the revolute joints whose limits look like degrees."""
    for joint in xml.findall("joint"):
        limit = joint.find("limit")
        if joint.get("type") != "revolute" or limit is None:
            continue
        ends = [float(limit.get(name, 0.0)) for name in ("lower", "upper")]
        if _TURNS < max(map(abs, ends)) < 1e3:
            yield Finding(
                "note",
                "units",
                f"joint {joint.get('name', '')!r}",
                f"it turns from {ends[0]:g} to {ends[1]:g} rad",
                "angles of a URDF are in rad: are these in degrees?",
            )


def check_maxima(xml: Element) -> Iterator[Finding]:
    """Yield the joints whose limits of speed or effort no joint reaches."""
    for joint in xml.findall("joint"):
        limit = joint.find("limit")
        if joint.get("type") not in _DRIVEN or limit is None:
            continue
        turns = joint.get("type") != "prismatic"
        speed, effort = (float(limit.get(x, 0.0)) for x in ("velocity", "effort"))
        name = f"joint {joint.get('name', '')!r}"
        if turns and _FAST < speed < 1e3:
            yield Finding(
                "note",
                "units",
                name,
                f"its velocity limit is {speed:g} rad/s",
                "angles of a URDF are in rad: is this in degrees?",
            )
        if effort > _STRONG:
            yield Finding(
                "note",
                "units",
                name,
                f"its effort limit is {effort:g} {'N·m' if turns else 'N'}",
                'for no limit give effort="0"; efforts of a URDF are in N·m or N',
            )


def check_density(xml: Element, robot: Robot) -> Iterator[Finding]:
    """Yield the links that are denser than any metal in the volume of their shapes."""
    moving = {f.name for f in robot.model.frames if f.parentJoint > 0}
    volumes: dict[str, float] = {}
    try:
        shapes = link_shapes(robot, "hulls")
    except ModelError:  # reported where it is used
        return
    for shape in shapes:
        volume = abs(float(shape.geometry.computeVolume()))
        volumes[shape.link] = volumes.get(shape.link, 0.0) + volume
    for link in xml.findall("link"):
        name, mass = link.get("name", ""), link.find("inertial/mass")
        if mass is None or name not in moving or link.find("collision") is None:
            continue
        kilograms, volume = float(mass.get("value", 0.0)), volumes.get(name, 0.0)
        if 0.0 < _DENSE * _DENSITY * volume < kilograms:
            yield Finding(
                "note",
                "units",
                f"link {name!r}",
                f"{kilograms:.3g} kg in collision shapes of {1e3 * volume:.3g} litres "
                f"are {kilograms / volume:.2g} kg/m³, denser than any metal",
                "masses of a URDF are in kg and lengths in m: is one in another unit? "
                "A shape that is smaller than its link hides the rest from distances",
            )


def check_mesh_sizes(xml: Element, source: RobotSource) -> Iterator[Finding]:
    """Yield the links whose collision meshes have another size than the visual ones."""
    for link in xml.findall("link"):
        sizes = [_size_of_meshes(link, use, source) for use in ("collision", "visual")]
        if not all(sizes):
            continue
        factor = sizes[0] / sizes[1]
        if not 1.0 / _SCALED < factor < _SCALED:
            yield Finding(
                "warning",
                "units",
                f"link {link.get('name', '')!r}",
                f"its collision mesh has a size of {sizes[0]:.3g} m, its visual one of "
                f"{sizes[1]:.3g} m",
                "is one in mm? give its scale",
            )


def _size_of_meshes(link: Element, use: str, source: RobotSource) -> float:
    """Return the largest diagonal of a link's meshes [m]; 0 if none can be read."""
    largest = 0.0
    for mesh in (each for owner in link.findall(use) for each in owner.iter("mesh")):
        file = find_file(source, mesh.get("filename", ""))
        if file is None or find_problem(file):
            continue
        scale = np.array([float(word) for word in mesh.get("scale", "1 1 1").split()])
        try:
            vertices = np.array(load_mesh(file, scale).vertices())
        except (RuntimeError, ValueError):  # reported where it is used
            continue
        if len(vertices):
            largest = max(largest, float(np.linalg.norm(np.ptp(vertices, axis=0))))
    return largest


def _known_points(xml: Element) -> dict[str, Array]:
    """Return origins of links and of the joints on them, by link [m]."""
    points = {each.get("name", ""): [np.zeros(3)] for each in xml.findall("link")}
    for joint in xml.findall("joint"):
        parent = joint.find("parent")
        if parent is not None and parent.get("link") in points:
            points[parent.get("link", "")].append(_xyz(joint.find("origin")))
    return {name: np.array(found) for name, found in points.items()}


def _xyz(origin: Element | None) -> Array:
    text = "0 0 0" if origin is None else origin.get("xyz", "0 0 0")
    return np.array([float(word) for word in text.split()])
