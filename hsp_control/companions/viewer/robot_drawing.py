"""Draws a robot: its visuals, or a capsule per link and a drum per joint."""

import logging
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import ModelError, RobotNotFoundError
from hsp_control.companions.plots.palette import JOINT, LINK
from hsp_control.companions.viewer import threejs
from hsp_control.companions.viewer.commands import (
    Json,
    LegendEntry,
    PageCommand,
    path_element,
    set_object,
    set_transform,
)
from hsp_control.companions.viewer.mesh_files import MeshFiles
from hsp_control.companions.viewer.motion import RunMotion, Track, pose_tracks
from hsp_control.geometry.links import part_of
from hsp_control.geometry.mesh_loading import facets, load_mesh
from hsp_control.robot import Robot
from hsp_control.robot.description.loading import RobotPart
from hsp_control.robot.description.mesh_files import candidates, find_problem
from hsp_control.robot.description.mesh_units import mesh_units
from hsp_control.robot.description.sources import BodyShape, RobotSource
from hsp_control.robot.description.urdf import read_urdf
from hsp_control.robot.recorded import text_of

_GREY = (0.72, 0.74, 0.76, 1.0)
_MESHES = {".dae", ".obj", ".stl"}  # formats that the page reads itself
_SIZES = {
    "box": ("size",),
    "cylinder": ("radius", "length"),
    "capsule": ("radius", "length"),
    "sphere": ("radius",),
    "mesh": ("scale",),
}


class Visual(NamedTuple):
    """One visual element of a link."""

    joint: int  # the index of its link's parent joint; 0: it does not move
    link: str
    pose: Array  # its pose in the joint's frame, (4, 4)
    # ``box``, ``cylinder``, ``sphere``, ``capsule``, ``ellipsoid`` or ``mesh``.
    kind: str
    # Its lengths [m] in the URDF's order, or an ellipsoid's semi-axes; of a mesh: its
    # scale.
    size: tuple[float, ...]
    color: tuple[float, ...]  # red, green, blue and opacity, from 0 to 1
    file: Path | None  # of a mesh: its file, or None if it is not found or not readable
    # Of a mesh without a file: vertices [m], (k, 3), and triangles of their indices,
    # (n, 3).
    mesh: tuple[Array, Indices] | None = None

    @property
    def missing(self) -> bool:
        """Whether it is a mesh that cannot be drawn."""
        return self.kind == "mesh" and self.file is None and self.mesh is None


def read_visuals(robot: Robot) -> list[Visual]:
    """Return the visuals of the robot's links; none of a URDF that no longer exists."""
    return [visual for part in robot.parts for visual in _of_part(robot, part)]


def _of_part(robot: Robot, part: RobotPart) -> Iterator[Visual]:
    if part.source.shapes is not None:
        yield from _given(robot, part, part.source.shapes)
        return
    try:
        tree = read_urdf(part.source)
    except (ModelError, RobotNotFoundError):
        return
    materials = dict(_materials(tree))
    for link in tree.iter("link"):
        name = part.prefix + link.get("name", "")
        if not robot.model.existBodyName(name):
            continue
        frame = robot.model.frames[robot.model.getBodyId(name)]
        for element in link.iter("visual"):
            visual = _visual(part.source, frame, element, materials)
            if visual is not None:
                yield visual


def _given(
    robot: Robot, part: RobotPart, shapes: Iterable[BodyShape]
) -> Iterator[Visual]:
    for shape in shapes:
        if shape.seen:
            frame = robot.model.frames[robot.frame_id(part.prefix + shape.body)]
            yield Visual(
                joint=frame.parentJoint,
                link=frame.name,
                pose=frame.placement.homogeneous @ shape.pose,
                kind=shape.kind,
                size=shape.size or (1.0, 1.0, 1.0),
                color=shape.color,
                file=None,
                mesh=shape.mesh,
            )


def _visual(
    source: RobotSource,
    frame: pin.Frame,
    element: Element,
    materials: dict[str, tuple[float, ...]],
) -> Visual | None:
    shape = next(iter(element.find("geometry") or ()), None)
    if shape is None or shape.tag not in _SIZES:
        return None
    size = tuple(x for n in _SIZES[shape.tag] for x in _numbers(shape.get(n)))
    visual = Visual(
        joint=frame.parentJoint,
        link=frame.name,
        pose=frame.placement.homogeneous @ _pose(element.find("origin")),
        kind=shape.tag,
        size=size or (1.0, 1.0, 1.0),
        color=_color(element.find("material"), materials) or _GREY,
        file=None,
    )
    file = _mesh_file(source, shape.get("filename", ""))
    return visual if file is None else _with_mesh(visual, file)


def _with_mesh(visual: Visual, file: Path) -> Visual:
    """Return a visual with the file that it is drawn from, in its unit and upright.

    Formats that the page cannot read are read here, as for distances.
    """
    units = mesh_units(file)
    turn = np.eye(4)
    turn[:3, :3] = units.turn
    size = tuple(units.scale(np.array(visual.size)).tolist())
    upright = visual._replace(pose=visual.pose @ turn, size=size)
    if file.suffix.lower() in _MESHES:
        return upright._replace(file=file)
    try:
        mesh = facets(load_mesh(file, np.array(visual.size)))
    except (RuntimeError, ValueError):  # treated as missing
        return visual
    return visual._replace(mesh=mesh) if len(mesh[1]) else visual


def _materials(tree: Element) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield (name, colour) of all named materials in the file."""
    for named in tree.iter("material"):
        color = named.find("color")
        if color is not None and named.get("name"):
            yield named.get("name", ""), _numbers(color.get("rgba"))


def _color(
    material: Element | None, named: dict[str, tuple[float, ...]]
) -> tuple[float, ...] | None:
    if material is None:
        return None
    own = material.find("color")
    if own is not None:
        return _numbers(own.get("rgba"))
    return named.get(material.get("name", ""))


def _pose(origin: Element | None) -> Array:
    if origin is None:
        return np.eye(4)
    rpy = np.array(_numbers(origin.get("rpy")) or (0.0, 0.0, 0.0))
    xyz = np.array(_numbers(origin.get("xyz")) or (0.0, 0.0, 0.0))
    pose: Array = pin.SE3(pin.rpy.rpyToMatrix(rpy), xyz).homogeneous
    return pose


def _mesh_file(source: RobotSource, name: str) -> Path | None:
    """Return the file that a mesh's name refers to, if it exists and may be read."""
    files = candidates(source, name)
    good = (f for f in files if not find_problem(f) and source.access.allows(f))
    return next(good, None)


def _numbers(text: str | None) -> tuple[float, ...]:
    return tuple(map(float, (text or "").split()))


_THICKNESS = 0.034  # a link's radius at the base, over the robot's size
_TAPER = 0.55  # the radius at the last joint, over that at the base


def placeholder(robot: Robot, joint: int) -> Json | None:
    """Return a drum at a joint and capsules to its children; None if there are none."""
    radius = _radius(robot, joint)
    surface = threejs.material(LINK, glow=0.5)
    things = [_drum(robot, joint, radius)] if joint else _feet(robot, radius)
    for start, end, end_radius in _links(robot, joint):
        length = float(np.linalg.norm(end - start))
        if length > radius:
            body = threejs.capsule(length, 0.8 * radius, 0.8 * end_radius)
            pose = threejs.pose_along(end - start)
            pose[:3, 3] = start
            things.append(threejs.mesh(body, surface, pose))
    return threejs.group(things) if things else None


def _links(robot: Robot, joint: int) -> Iterator[tuple[Array, Array, float]]:
    """Yield the capsules of a joint: start [m], end [m], radius at the end [m]."""
    model = robot.model
    children = [
        child for child in range(1, model.njoints) if model.parents[child] == joint
    ]
    for child in children:
        own = part_of(robot, model.names[child]).placement.translation
        start = np.zeros(3) if joint else own
        end = model.jointPlacements[child].translation
        yield start, end, _radius(robot, child)
    if joint and not children:
        tips = [f.placement.translation for f in model.frames if f.parentJoint == joint]
        tip = max(tips, key=lambda point: float(np.linalg.norm(point)))
        if not np.any(tip):
            tip = model.inertias[joint].lever
        yield np.zeros(3), tip, _TAPER * _radius(robot, joint)


def _feet(robot: Robot, radius: float) -> list[Json]:
    """Return the base plates of robots that are fixed to the ground."""
    surface = threejs.material(JOINT)
    plate = [2.2 * radius, 0.4 * radius, 0.15 * radius]
    return [
        threejs.mesh(
            threejs.rounded_cylinder(*plate), surface, part.placement.homogeneous
        )
        for part in robot.parts
        if part.source.root == "fixed"
    ]


def _drum(robot: Robot, joint: int, radius: float) -> Json:
    """Return the drum that shows a joint's position and axis."""
    surface = threejs.material(JOINT)
    model = robot.model
    if model.joints[joint].nv != 1:
        return threejs.mesh(threejs.sphere(1.15 * radius), surface)
    data = model.createData()
    pin.computeJointJacobians(model, data, robot.neutral())
    motion = np.asarray(data.joints[joint].S).reshape(6, -1)[:, 0]
    turns = bool(np.any(motion[3:]))
    pose = threejs.pose_along(motion[3:] if turns else motion[:3])
    if turns:
        drum = threejs.rounded_cylinder(1.15 * radius, 2.5 * radius, 0.25 * radius)
        return threejs.mesh(drum, surface, pose)
    return threejs.mesh(
        threejs.box([2.0 * radius, 2.0 * radius, 3.0 * radius]), surface, pose
    )


def _radius(robot: Robot, joint: int) -> float:
    """Return a link's radius at its joint [m]; it decreases towards the last joint."""
    model = robot.model
    depth = [0] * model.njoints
    for index in range(1, model.njoints):
        depth[index] = depth[model.parents[index]] + 1
    fraction = depth[joint] / max(depth)
    return _THICKNESS * robot.size * (1.0 - (1.0 - _TAPER) * fraction)


ROOT = "/robot"  # default node of a robot in the scene tree


_log = logging.getLogger(__name__)


def robot_entry(root: str = ROOT) -> LegendEntry:
    """Return the legend's entry of a robot whose node is ``root``."""
    return LegendEntry("robot", LINK, (root,), plain=True)


class RobotDrawing:
    """A robot's nodes, one per joint; capsules and drums replace missing meshes."""

    def __init__(self, robot: Robot, root: str = ROOT) -> None:
        """Read the robot's visuals; log a warning if meshes are missing."""
        self.robot = robot
        self._visuals = read_visuals(robot)
        self._nodes = [f"{root}/{path_element(name)}" for name in robot.model.names]
        missing = [visual for visual in self._visuals if visual.missing]
        self._placeholders = {visual.joint for visual in missing}
        if not self._visuals:
            self._placeholders = set(range(robot.model.njoints))
        if missing:
            _log.warning(
                "%s: %d of %d meshes are not found or cannot be read (the first "
                "belongs to link %r)%s; capsules are drawn instead",
                robot.name,
                len(missing),
                sum(visual.kind == "mesh" for visual in self._visuals),
                missing[0].link,
                _hint(robot),
            )

    def draw(self) -> Iterable[PageCommand]:
        """Yield the commands that draw the robot."""
        for joint in sorted(self._placeholders):
            body = placeholder(self.robot, joint)
            if body is not None:
                yield set_object(f"{self._nodes[joint]}/placeholder", body)
        links: dict[tuple[int, str], list[Json]] = {}
        files = MeshFiles()
        for visual in self._visuals:
            thing = _thing(visual)
            if thing is not None:
                own = links.setdefault((visual.joint, visual.link), [])
                own.append(files.taken_from(thing))
        yield from files.commands()
        for (joint, link), things in links.items():
            path = f"{self._nodes[joint]}/{path_element(link)}"
            yield set_object(path, threejs.group(things))

    def move(self, placements: Sequence[pin.SE3]) -> list[PageCommand]:
        """Return the commands that move the joints to their placements in the world."""
        return [
            set_transform(node, placements[joint].homogeneous)
            for joint, node in enumerate(self._nodes)
            if joint > 0
        ]

    def tracks(self, motion: RunMotion) -> Iterator[Track]:
        """Yield the tracks of the joints along a run."""
        poses = motion.joint_poses()
        for joint, node in enumerate(self._nodes[1:], start=1):
            yield from pose_tracks(node, motion.times, poses[:, joint])

    def points(self, placements: Sequence[pin.SE3]) -> Array:
        """Return the positions of all frames in the world [m], shape (K, 3)."""
        frames = [
            placements[frame.parentJoint].act(frame.placement).translation
            for frame in self.robot.model.frames
        ]
        return np.array(frames)

    def fixed_points(self) -> Array:
        """Return the origin and the feet of the fixed visuals [m], shape (K, 3)."""
        points = [np.zeros(3)]
        for visual in self._visuals:
            if visual.joint == 0 and visual.kind in {"box", "cylinder", "sphere"}:
                lowest = visual.pose[2, 3] - _half_height(visual)
                points.append(np.array([*visual.pose[:2, 3], lowest]))
        return np.array(points)


def _half_height(visual: Visual) -> float:
    """Return half the height of a shape in the world [m]."""
    z = np.abs(visual.pose[2, :3])
    if visual.kind == "sphere":
        return visual.size[0]
    if visual.kind == "box":
        return float(z @ np.array(visual.size)) / 2.0
    radius, length = visual.size
    return float(z[2] * length / 2.0 + np.hypot(z[0], z[1]) * radius)


def _thing(visual: Visual) -> Json | None:
    """Return one piece of a link, or None if it cannot be shown."""
    surface = threejs.material(visual.color, opacity=visual.color[3])
    size, pose = visual.size, visual.pose
    match visual.kind:
        case "box":
            return threejs.mesh(threejs.box(size), surface, pose)
        case "sphere":
            return threejs.mesh(threejs.sphere(size[0]), surface, pose)
        case "cylinder":
            return threejs.mesh(threejs.cylinder(*size), surface, pose)
        case "capsule":
            half = threejs.pose_at([0.0, 0.0, -size[1] / 2.0])
            body = threejs.capsule(size[1], size[0], size[0])
            return threejs.mesh(body, surface, pose @ half)
        case "ellipsoid":
            ball = threejs.sphere(1.0)
            return threejs.mesh(ball, surface, pose @ np.diag([*size, 1.0]))
    if visual.mesh is not None:
        return threejs.mesh(threejs.facets(*visual.mesh), surface, pose)
    if visual.file is None:
        return None
    pose = pose @ np.diag([*visual.size, 1.0])
    if visual.file.suffix.lower() != ".dae":
        return threejs.mesh(threejs.mesh_geometry(visual.file), surface, pose)
    thing = threejs.collada_object(visual.file)
    thing["object"] |= {
        "matrix": threejs.matrix(pose),
        "castShadow": True,
        "receiveShadow": True,
    }
    return thing


def _hint(robot: Robot) -> str:
    texts = [
        text_of(part.source).decode(errors="replace")
        for part in robot.parts
        if part.source.shapes is None
    ]
    if any("package://example-robot-data" in text for text in texts):
        return "; they come with: pip install example-robot-data-loaders"
    return ""
