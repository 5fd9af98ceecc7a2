"""Shapes of the robot's links for distances, and the pairs that can collide."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, get_args
from weakref import WeakKeyDictionary
from xml.etree.ElementTree import Element, SubElement

import coal
import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError
from hsp_control.common.suggestions import listing
from hsp_control.geometry.enclosing import (
    convex_hull,
    enclosing_capsule,
    enclosing_ellipsoid_capsule,
    hull_corners,
)
from hsp_control.geometry.mesh_loading import mesh_of, why_unread
from hsp_control.robot import Robot
from hsp_control.robot.description import mesh_files
from hsp_control.robot.description.loading import RobotPart, collect_parser_errors
from hsp_control.robot.description.mesh_units import MeshUnits, mesh_units
from hsp_control.robot.description.sources import PINOCCHIO, BodyShape, RobotSource
from hsp_control.robot.description.srdf import excluded_pairs
from hsp_control.robot.description.urdf import (
    admit_capsules,
    parser_text,
    read_urdf,
    why_no_shape,
)

Proxy = Literal["capsules", "spheres", "hulls", "meshes"]

FALLBACK_RADIUS = 0.05
"""Radius of the capsules between the joints of a robot without geometry [m]."""

_MAX_SPHERES = 100
"""Maximum number of intervals between spheres on a capsule; a usual link has 10."""

_log = logging.getLogger(__name__)
_found: "WeakKeyDictionary[Robot, dict[Proxy, tuple[LinkShape, ...]]]" = (
    WeakKeyDictionary()
)


@dataclass(frozen=True)
class LinkShape:
    """A shape fixed to a joint."""

    link: str  # name of the link, for SRDF files and messages
    joint: int  # index of the joint that it is fixed to; 0 is the world
    placement: pin.SE3  # its placement in the joint's frame
    geometry: Any  # coal's geometry


def link_shapes(robot: Robot, proxy: Proxy = "capsules") -> list[LinkShape]:
    """Return the shapes of the robot's links, which are computed once per robot.

    A robot without collision geometry gets capsules between its joints, and a warning;
    meshes that do not exist are left out, with a warning.

    Args:
        robot: The robot.
        proxy: ``capsules``: the smallest capsule around each shape; distances are 200
            times faster than with meshes, and their gradients are exact, and smooth
            for spheres. ``spheres``: spheres along these capsules; gradients are
            smooth for all convex obstacles. ``hulls``, ``meshes``: the robot's own
            collision geometry, as convex hulls or as it is.
    """
    if proxy not in get_args(Proxy):
        raise ModelError(f"proxy {proxy!r} is not one of {', '.join(get_args(Proxy))}")
    known = _found.setdefault(robot, {})
    if "meshes" not in known:
        known["meshes"] = tuple(_own_shapes(robot))
    if proxy not in known:
        known[proxy] = tuple(_approximated(known["meshes"], proxy))
    return list(known[proxy])


def _own_shapes(robot: Robot) -> list[LinkShape]:
    """Return the collision geometry of the links as it is, or its replacement."""
    own = {part.prefix: _collision_shapes(robot, part) for part in robot.parts}
    without = [part for part in robot.parts if not own[part.prefix]]
    if without:
        _log.warning(
            "%s has no collision geometry: using capsules of radius %g m between its "
            "joints", " and ".join(part.prefix + part.source.name for part in without),
            FALLBACK_RADIUS,
        )  # fmt: skip
    own |= {part.prefix: _between_joints(robot, part) for part in without}
    return [shape for part_shapes in own.values() for shape in part_shapes]


def _approximated(shapes: Sequence[LinkShape], proxy: Proxy) -> list[LinkShape]:
    if proxy == "hulls":
        return [_replaced(shape, _hull(shape.geometry)) for shape in shapes]
    capsules = [_capsule(shape) for shape in _merge_rounded_cylinders(shapes)]
    if proxy == "capsules":
        return capsules
    return [sphere for capsule in capsules for sphere in _spheres_along(capsule)]


def part_of(robot: Robot, name: str) -> RobotPart:
    """Return the part of a combined robot to which a joint or link name belongs."""
    parts = [part for part in robot.parts if name.startswith(part.prefix)]
    return max(parts, key=lambda part: len(part.prefix))


def _collision_shapes(robot: Robot, part: RobotPart) -> list[LinkShape]:
    """Return the collision geometry of a part, fixed to the joints of the robot."""
    if part.source.shapes is None:
        return _shapes_of_urdf(robot, part)
    shapes = []
    for shape in part.source.shapes:
        if shape.collides:
            name = part.prefix + shape.body
            frame = robot.model.frames[robot.frame_id(name)]
            place = frame.placement * pin.SE3(shape.pose)
            geometry = _body_geometry(shape, as_is=part.source.origin == PINOCCHIO)
            shapes.append(LinkShape(name, frame.parentJoint, place, geometry))
    return shapes


def _body_geometry(shape: BodyShape, *, as_is: bool) -> Any:
    """Return Coal's geometry; of a mesh its convex hull, unless it is flat or as is."""
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
    mesh = mesh_of(*shape.mesh)
    return mesh if as_is else convex_hull(mesh) or mesh


def _shapes_of_urdf(robot: Robot, part: RobotPart) -> list[LinkShape]:
    """Return the URDF's collision geometry, fixed to the joints of the robot.

    The robot may have fewer joints than the URDF, since joints can be locked. So the
    joint of a shape is found by the name of the shape's frame.
    """
    source = part.source
    xml = read_urdf(source)
    _leave_out_refused(xml, part)
    missing = _locate_meshes(xml, source)
    admit_capsules(xml)
    text = parser_text(xml, "visual")
    parser_errors: list[str] = []
    try:
        with collect_parser_errors(parser_errors):
            full = pin.buildModelFromXML(text, mimic=False)
            geometry = pin.buildGeomFromUrdfString(
                full, text, pin.GeometryType.COLLISION
            )
    except (ValueError, RuntimeError) as error:
        reason = why_unread(error)
        raise ModelError(f"{source.urdf}: a collision mesh: {reason}") from error
    if parser_errors:
        left_out = "; ".join(dict.fromkeys(parser_errors))
        _log.warning("%s: Pinocchio leaves out shapes: %s", source.urdf, left_out)
    if missing:
        _report_missing(part, missing, left=len(geometry.geometryObjects))
    shapes = []
    for item in geometry.geometryObjects:
        frame = full.frames[item.parentFrame]
        name = part.prefix + frame.name
        if not _finite(item.geometry):
            raise ModelError(
                f"{source.urdf}: a collision mesh: {item.meshPath} contains NaN or inf"
            )
        # In a combined robot, the frame of a part's world is called <prefix>universe.
        own = robot.model.frames[robot.frame_id(name)]
        shapes.append(
            LinkShape(
                link=name,
                joint=own.parentJoint,
                placement=own.placement * frame.placement.actInv(item.placement),
                geometry=item.geometry,
            )
        )
    return shapes


def _leave_out_refused(xml: Element, part: RobotPart) -> None:
    """Remove shapes that the parser refuses, which would take all others of a link."""
    refused: dict[str, str] = {}
    for link in xml.iter("link"):
        for element in link.findall("collision"):
            if why := why_no_shape(element):
                refused.setdefault(link.get("name", ""), why)
                link.remove(element)
    if refused:
        _log.warning(
            "%s: collision shapes of %d links cannot be read, which distances "
            "therefore do not see: %s (%s)",
            part.prefix + part.source.name, len(refused), listing(map(repr, refused)),
            next(iter(refused.values())),
        )  # fmt: skip


def _locate_meshes(xml: Element, source: RobotSource) -> dict[str, str]:
    """Put meshes' paths and units into a URDF, without missing ones.

    Return the missing ones by link.
    """
    missing: dict[str, str] = {}
    for link in xml.iter("link"):
        for element in link.findall("collision"):
            for mesh in element.iter("mesh"):
                name = mesh.get("filename", "")
                file = mesh_files.find_file(source, name)
                if file is None:
                    missing.setdefault(link.get("name", ""), name)
                    link.remove(element)
                    break
                if reason := mesh_files.find_problem(file):
                    raise ModelError(
                        f"{source.urdf}: a collision mesh: {file}: {reason}"
                    )
                mesh.set("filename", str(file.resolve()))
                _write_units(element, mesh, mesh_units(file))
    return missing


def _write_units(collision: Element, mesh: Element, units: MeshUnits) -> None:
    """Write a mesh's unit and up axis into its scale and its place."""
    scale = _numbers(mesh.get("scale", "1 1 1"))
    mesh.set("scale", " ".join(map(repr, units.scale(scale).tolist())))
    if units.up == MeshUnits().up:
        return
    if (origin := collision.find("origin")) is None:
        origin = SubElement(collision, "origin")
    turn = pin.rpy.rpyToMatrix(_numbers(origin.get("rpy", "0 0 0"))) @ units.turn
    origin.set("rpy", " ".join(map(repr, pin.rpy.matrixToRpy(turn).tolist())))


def _numbers(text: str) -> Array:
    return np.array([float(word) for word in text.split()])


def _report_missing(part: RobotPart, missing: Mapping[str, str], left: int) -> None:
    """Warn of meshes that do not exist."""
    name = next(iter(missing.values()))
    hint = mesh_files.where_to_put(name)
    if not left:
        raise ModelError(
            f"{part.source.urdf}: a collision mesh: no file {name!r}, and no other "
            f"shape of a link is left; {hint}, or give the links primitives"
        )
    _log.warning(
        "%s: collision meshes of %d links are missing, which distances therefore do "
        "not see: %s (%s); %s",
        part.prefix + part.source.name, len(missing), listing(missing), name, hint,
    )  # fmt: skip


def _finite(geometry: Any) -> bool:
    """Return whether all vertices of a mesh are finite; other shapes have none."""
    if not hasattr(geometry, "vertices"):
        return True
    return bool(np.isfinite(np.array(geometry.vertices())).all())


def _between_joints(robot: Robot, part: RobotPart) -> list[LinkShape]:
    """Return capsules between the joints, and spheres at last joints."""
    model = robot.model
    joints = [
        i for i in range(1, model.njoints) if part_of(robot, model.names[i]) is part
    ]
    shapes = []
    for child in joints:
        parent, end = model.parents[child], model.jointPlacements[child].translation
        # The parts share the world, so they use different names for it.
        name = model.names[parent] if parent else f"{part.prefix}universe"
        start = np.zeros(3) if parent else part.placement.translation
        placement, length = _placement_along(start, end)
        if length > 1e-6:
            geometry = coal.Capsule(FALLBACK_RADIUS, length)
            shapes.append(LinkShape(name, parent, placement, geometry))
    last = [i for i in joints if i not in list(model.parents)]
    shapes.extend(
        LinkShape(model.names[i], i, pin.SE3.Identity(), coal.Sphere(FALLBACK_RADIUS))
        for i in last
    )
    return shapes


def _merge_rounded_cylinders(shapes: Sequence[LinkShape]) -> list[LinkShape]:
    """Merge cylinders with spheres at both ends: URDFs describe capsules so."""
    merged: list[LinkShape] = []
    used: set[int] = set()
    for i, shape in enumerate(shapes):
        if i in used:
            continue
        ends = _end_spheres(shapes, i)
        if ends is None:
            merged.append(shape)
            continue
        used.update(ends)
        cylinder = shape.geometry
        capsule = coal.Capsule(cylinder.radius, 2.0 * cylinder.halfLength)
        merged = [m for m in merged if all(m is not shapes[k] for k in ends)]
        merged.append(_replaced(shape, capsule))
    return merged


def _end_spheres(shapes: Sequence[LinkShape], index: int) -> list[int] | None:
    """Return the indices of the spheres at both ends of a cylinder, or None."""
    shape = shapes[index]
    cylinder = shape.geometry
    if not isinstance(cylinder, coal.Cylinder):
        return None
    spheres = []
    for side in (-1.0, 1.0):
        end = shape.placement.act(np.array([0.0, 0.0, side * cylinder.halfLength]))
        for k, other in enumerate(shapes):
            if (
                isinstance(other.geometry, coal.Sphere)
                and other.link == shape.link
                and abs(other.geometry.radius - cylinder.radius) < 1e-6
                and float(np.linalg.norm(other.placement.translation - end)) < 1e-3
            ):
                spheres.append(k)
                break
    return spheres if len(set(spheres)) == 2 else None


def _capsule(shape: LinkShape) -> LinkShape:
    """Return the smallest capsule that contains a shape."""
    geometry = shape.geometry
    if isinstance(geometry, coal.Sphere | coal.Capsule):
        return shape
    if isinstance(geometry, coal.Cylinder):
        return _replaced(
            shape, coal.Capsule(geometry.radius, 2.0 * geometry.halfLength)
        )
    if isinstance(geometry, coal.Ellipsoid):
        placement, radius, length = enclosing_ellipsoid_capsule(geometry)
    else:
        first, second, radius = enclosing_capsule(_points(shape))
        placement, length = _placement_along(first, second)
    return LinkShape(
        shape.link,
        shape.joint,
        shape.placement * placement,
        coal.Capsule(radius, length) if length > 1e-9 else coal.Sphere(radius),
    )


def _spheres_along(capsule: LinkShape) -> list[LinkShape]:
    """Return spheres along a capsule that contain it, at most one radius apart."""
    if isinstance(capsule.geometry, coal.Sphere):
        return [capsule]
    radius, half = capsule.geometry.radius, capsule.geometry.halfLength
    apart = max(radius, 2.0 * half / _MAX_SPHERES)
    number = max(int(np.ceil(2.0 * half / apart)), 1) + 1
    # The spheres must contain the side of the capsule half-way between two centres.
    gap = 2.0 * half / (number - 1)
    larger_radius = float(np.hypot(radius, 0.5 * gap))
    spheres = []
    for z in np.linspace(-half, half, number):
        place = capsule.placement * pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))
        sphere = coal.Sphere(larger_radius)
        spheres.append(LinkShape(capsule.link, capsule.joint, place, sphere))
    return spheres


def _points(shape: LinkShape) -> Array:
    """Return points whose convex hull is the shape's, shape (k, 3) [m]."""
    geometry = shape.geometry
    if isinstance(geometry, coal.Box):
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        return np.asarray(signs * np.asarray(geometry.halfSide))
    if hasattr(geometry, "vertices"):
        return hull_corners(np.array(geometry.vertices()))
    if hasattr(geometry, "points"):
        return np.array(geometry.points())
    raise ModelError(
        f"link {shape.link!r}: cannot fit a capsule to a {type(geometry).__name__}; "
        "use proxy: meshes"
    )


def _hull(geometry: Any) -> Any:
    """Return the convex hull of a mesh; other shapes and flat meshes as they are."""
    if hasattr(geometry, "buildConvexHull"):
        return convex_hull(geometry) or geometry
    return geometry


def _placement_along(first: Array, second: Array) -> tuple[pin.SE3, float]:
    """Return the pose half-way between points, z along them, and their distance."""
    line = second - first
    length = float(np.linalg.norm(line))
    if length == 0.0:
        return pin.SE3(np.eye(3), first), 0.0
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), line)
    return pin.SE3(turn.matrix(), 0.5 * (first + second)), length


def _replaced(shape: LinkShape, geometry: Any) -> LinkShape:
    return LinkShape(shape.link, shape.joint, shape.placement, geometry)


# --- pairs of them that can collide ---------------------------------------------------


def self_pairs(robot: Robot, links: Sequence[LinkShape]) -> list[tuple[int, int]]:
    """Return the pairs of link shapes that can collide, as indices into ``links``.

    Neighbours, which always touch, and pairs that the SRDF or MJCF disables are left
    out.
    """
    disabled = _disabled(robot, links)
    parents = list(robot.model.parents)
    pairs = []
    for i, first in enumerate(links):
        for j in range(i + 1, len(links)):
            second = links[j]
            a, b = first.joint, second.joint
            if a == b or _neighbours(robot, first, second, parents):
                continue
            if frozenset((first.link, second.link)) in disabled:
                continue
            pairs.append((i, j))
    return pairs


def _neighbours(
    robot: Robot, first: LinkShape, second: LinkShape, parents: Sequence[int]
) -> bool:
    """Return whether a link's joint is the parent of the other's, in one part."""
    a, b = first.joint, second.joint
    if parents[a] != b and parents[b] != a:
        return False
    return min(a, b) > 0 or part_of(robot, first.link) is part_of(robot, second.link)


def _disabled(robot: Robot, links: Sequence[LinkShape]) -> set[frozenset[str]]:
    disabled = set[frozenset[str]]()
    for part in robot.parts:
        own = {x.link for x in links if part_of(robot, x.link) is part}
        bare = [link.removeprefix(part.prefix) for link in own]
        for pair in excluded_pairs(part.source, bare):
            disabled.add(frozenset(part.prefix + link for link in pair))
    return disabled
