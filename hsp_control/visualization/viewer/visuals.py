"""The visual elements of a robot, read without loading meshes."""

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import ModelError, RobotNotFoundError
from hsp_control.robot import Robot
from hsp_control.robot.description.loading import RobotPart
from hsp_control.robot.description.mesh_files import candidates, find_problem
from hsp_control.robot.description.sources import BodyShape, RobotSource
from hsp_control.robot.description.urdf import read_urdf

_GREY = (0.72, 0.74, 0.76, 1.0)
_MESHES = {".dae", ".obj", ".stl"}  # formats that the page can read
_NO_NUMBERS: tuple[float, ...] = ()
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
    size = sum((_numbers(shape.get(name)) for name in _SIZES[shape.tag]), _NO_NUMBERS)
    return Visual(
        joint=frame.parentJoint,
        link=frame.name,
        pose=frame.placement.homogeneous @ _pose(element.find("origin")),
        kind=shape.tag,
        size=size or (1.0, 1.0, 1.0),
        color=_color(element.find("material"), materials) or _GREY,
        file=_mesh_file(source, shape.get("filename", "")),
    )


def _materials(tree: Element) -> Iterator[tuple[str, tuple[float, ...]]]:
    """Yield (name, colour) of all named materials in the file."""
    for material in tree.iter("material"):
        color = material.find("color")
        if color is not None and material.get("name"):
            yield material.get("name", ""), _numbers(color.get("rgba"))


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
    """Return the file that a mesh's name refers to, if it exists and can be shown."""
    return next(
        (
            file
            for file in candidates(source, name)
            if file.suffix.lower() in _MESHES
            and not find_problem(file)
            and source.access.allows(file)
        ),
        None,
    )


def _numbers(text: str | None) -> tuple[float, ...]:
    return tuple(map(float, (text or "").split()))
