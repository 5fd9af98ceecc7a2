"""What the robot's links look like to a distance: capsules, or its own shapes."""

import logging
from dataclasses import dataclass
from typing import Any, Literal, get_args
from weakref import WeakSet

import coal
import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ModelError
from hsp_control.geometry.capsule_fit import enclosing_capsule
from hsp_control.geometry.hulls import convex_hull, hull_corners
from hsp_control.robot import Robot
from hsp_control.robot.description import mesh_files
from hsp_control.robot.description.combining import Part
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.urdf_checks import read_urdf

Proxy = Literal["capsules", "spheres", "hulls", "meshes"]

FALLBACK_RADIUS = 0.05
"""Radius of the capsules between joints where a robot has no geometry [m]."""

_MOST_BEADS = 100
"""Along one capsule; a link's own geometry needs ten."""

_log = logging.getLogger(__name__)
_warned: "WeakSet[Robot]" = WeakSet()


@dataclass(frozen=True)
class LinkShape:
    """A shape fixed to a joint.

    Attributes:
        link: Name of the link, as SRDF files and messages call it.
        joint: Index of the joint that carries it; 0 is the world.
        placement: Its placement in the joint's frame.
        geometry: Coal's geometry.
    """

    link: str
    joint: int
    placement: pin.SE3
    geometry: Any


def link_shapes(robot: Robot, proxy: Proxy = "capsules") -> list[LinkShape]:
    """Return the shapes of the robot's links.

    ``capsules``, the default, are 200 times faster than meshes and have exact, smooth
    gradients against balls; ``spheres`` are beads along those capsules,
    smooth against everything convex; ``hulls`` and ``meshes`` are the robot's own
    collision geometry. A robot without any gets capsules between its joints, and
    one warning.

    Raises:
        ModelError: If a collision mesh cannot be read, or the proxy is unknown.
    """
    if proxy not in get_args(Proxy):
        raise ModelError(f"proxy {proxy!r}: choose among {', '.join(get_args(Proxy))}")
    own = {part.prefix: _collision_shapes(robot, part) for part in robot.parts}
    bare = [part for part in robot.parts if not own[part.prefix]]
    if bare and robot not in _warned:
        _warned.add(robot)
        _log.warning(
            "%s has no collision geometry: using capsules of radius %g m between its "
            "joints", " and ".join(part.prefix + part.source.name for part in bare),
            FALLBACK_RADIUS,
        )  # fmt: skip
    own |= {part.prefix: _between_joints(robot, part) for part in bare}
    shapes = [shape for of_part in own.values() for shape in of_part]
    if proxy == "meshes":
        return shapes
    if proxy == "hulls":
        return [_replaced(shape, _hull(shape.geometry)) for shape in shapes]
    capsules = [_capsule(shape) for shape in _merge_rounded_cylinders(shapes)]
    if proxy == "capsules":
        return capsules
    return [bead for capsule in capsules for bead in _beads(capsule)]


def part_of(robot: Robot, name: str) -> Part:
    """Return which of a combined robot's parts a joint or a link belongs to."""
    parts = [part for part in robot.parts if name.startswith(part.prefix)]
    return max(parts, key=lambda part: len(part.prefix))


def _collision_shapes(robot: Robot, part: Part) -> list[LinkShape]:
    """Read the URDF's collision geometry and hang it on the robot's own joints.

    The robot may have locked joints that the URDF has not: a shape is found again by
    the name of the frame that it is fixed to.
    """
    source = part.source
    for name in _collision_meshes(source):
        _refuse_bad_mesh(source, name)
    full = pin.buildModelFromUrdf(str(source.urdf), mimic=False)
    try:
        geometry = pin.buildGeomFromUrdf(
            full,
            str(source.urdf),
            pin.GeometryType.COLLISION,
            package_dirs=[str(folder) for folder in source.package_dirs],
        )
    except (ValueError, RuntimeError) as error:
        reason = (str(error).strip() or type(error).__name__).splitlines()[0]
        raise ModelError(f"{source.urdf}: a collision mesh: {reason}") from error
    shapes = []
    for item in geometry.geometryObjects:
        frame = full.frames[item.parentFrame]
        name = part.prefix + frame.name
        if not _finite(item.geometry):
            raise ModelError(
                f"{source.urdf}: a collision mesh: {item.meshPath} has a corner "
                "at a NaN or an infinity"
            )
        # What is fixed to a combined robot's root hangs on its universe's namesake.
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


def _collision_meshes(source: RobotSource) -> list[str]:
    elements = read_urdf(source.urdf).iter("collision")
    meshes = (mesh for element in elements for mesh in element.iter("mesh"))
    return list(dict.fromkeys(mesh.get("filename", "") for mesh in meshes))


def _refuse_bad_mesh(source: RobotSource, name: str) -> None:
    """Look at a mesh before Assimp does; one that is missing is Pinocchio's to tell."""
    found = (file for file in mesh_files.candidates(source, name) if file.is_file())
    file = next(found, None)
    if file is not None and (reason := mesh_files.complaint(file)):
        raise ModelError(f"{source.urdf}: a collision mesh: {file}: {reason}")


def _finite(geometry: Any) -> bool:
    """Return whether a mesh's corners are somewhere; other shapes have none."""
    if not hasattr(geometry, "vertices"):
        return True
    return bool(np.isfinite(np.array(geometry.vertices())).all())


def _between_joints(robot: Robot, part: Part) -> list[LinkShape]:
    model = robot.model
    joints = [
        i for i in range(1, model.njoints) if part_of(robot, model.names[i]) is part
    ]
    shapes = []
    for child in joints:
        parent, end = model.parents[child], model.jointPlacements[child].translation
        # The world is no joint of the part's own: it goes by a name of the part's.
        name = model.names[parent] if parent else f"{part.prefix}universe"
        start = np.zeros(3) if parent else part.placement.translation
        placement, length = _along(start, end)
        if length > 1e-6:
            geometry = coal.Capsule(FALLBACK_RADIUS, length)
            shapes.append(LinkShape(name, parent, placement, geometry))
    last = [i for i in joints if i not in list(model.parents)]
    shapes.extend(
        LinkShape(model.names[i], i, pin.SE3.Identity(), coal.Sphere(FALLBACK_RADIUS))
        for i in last
    )
    return shapes


def _merge_rounded_cylinders(shapes: list[LinkShape]) -> list[LinkShape]:
    """Merge a cylinder and the two balls that close it, as URDFs write capsules."""
    merged: list[LinkShape] = []
    used: set[int] = set()
    for i, shape in enumerate(shapes):
        if i in used:
            continue
        ends = _closing_balls(shapes, i)
        if ends is None:
            merged.append(shape)
            continue
        used.update(ends)
        cylinder = shape.geometry
        capsule = coal.Capsule(cylinder.radius, 2.0 * cylinder.halfLength)
        merged = [m for m in merged if all(m is not shapes[k] for k in ends)]
        merged.append(_replaced(shape, capsule))
    return merged


def _closing_balls(shapes: list[LinkShape], index: int) -> list[int] | None:
    shape = shapes[index]
    cylinder = shape.geometry
    if not isinstance(cylinder, coal.Cylinder):
        return None
    balls = []
    for side in (-1.0, 1.0):
        end = shape.placement.act(np.array([0.0, 0.0, side * cylinder.halfLength]))
        for k, other in enumerate(shapes):
            if (
                isinstance(other.geometry, coal.Sphere)
                and other.link == shape.link
                and abs(other.geometry.radius - cylinder.radius) < 1e-6
                and float(np.linalg.norm(other.placement.translation - end)) < 1e-3
            ):
                balls.append(k)
                break
    return balls if len(set(balls)) == 2 else None


def _capsule(shape: LinkShape) -> LinkShape:
    """Return the smallest capsule that holds a shape."""
    geometry = shape.geometry
    if isinstance(geometry, coal.Sphere | coal.Capsule):
        return shape
    if isinstance(geometry, coal.Cylinder):
        return _replaced(
            shape, coal.Capsule(geometry.radius, 2.0 * geometry.halfLength)
        )
    first, second, radius = enclosing_capsule(_points(shape))
    placement, length = _along(first, second)
    return LinkShape(
        shape.link,
        shape.joint,
        shape.placement * placement,
        coal.Capsule(radius, length) if length > 1e-9 else coal.Sphere(radius),
    )


def _beads(capsule: LinkShape) -> list[LinkShape]:
    """Return balls along a capsule, no farther apart than its radius.

    Along a needle they are fewer, and grow to cover it.
    """
    if isinstance(capsule.geometry, coal.Sphere):
        return [capsule]
    radius, half = capsule.geometry.radius, capsule.geometry.halfLength
    apart = max(radius, 2.0 * half / _MOST_BEADS)
    number = max(int(np.ceil(2.0 * half / apart)), 1) + 1
    # Half-way between two balls the capsule's side stands out by this factor.
    gap = 2.0 * half / (number - 1)
    grown = float(np.hypot(radius, 0.5 * gap))
    beads = []
    for z in np.linspace(-half, half, number):
        place = capsule.placement * pin.SE3(np.eye(3), np.array([0.0, 0.0, z]))
        beads.append(LinkShape(capsule.link, capsule.joint, place, coal.Sphere(grown)))
    return beads


def _points(shape: LinkShape) -> Array:
    geometry = shape.geometry
    if isinstance(geometry, coal.Box):
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1).T
        return np.asarray(signs * np.asarray(geometry.halfSide))
    if hasattr(geometry, "vertices"):
        return hull_corners(np.array(geometry.vertices()))
    if hasattr(geometry, "points"):
        return np.array(geometry.points())
    raise ModelError(
        f"link {shape.link!r}: no capsule for a {type(geometry).__name__}; use meshes"
    )


def _hull(geometry: Any) -> Any:
    """Return a mesh's convex hull, or what has none as it is."""
    if hasattr(geometry, "buildConvexHull"):
        return convex_hull(geometry) or geometry
    return geometry


def _along(first: Array, second: Array) -> tuple[pin.SE3, float]:
    """Return the placement whose z axis leads from one point to another."""
    between = second - first
    length = float(np.linalg.norm(between))
    if length == 0.0:
        return pin.SE3(np.eye(3), first), 0.0
    turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), between)
    return pin.SE3(turn.matrix(), 0.5 * (first + second)), length


def _replaced(shape: LinkShape, geometry: Any) -> LinkShape:
    return LinkShape(shape.link, shape.joint, shape.placement, geometry)
