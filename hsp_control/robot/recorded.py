"""The robot of a log: its record, and the robot made from it."""

import logging
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import pinocchio as pin

from hsp_control.common.errors import (
    HspControlError,
    ModelError,
    RobotNotFoundError,
)
from hsp_control.common.resources import is_file
from hsp_control.common.suggestions import listing
from hsp_control.common.warned import warn
from hsp_control.declaration.plain_data import plain_data
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.loading import RobotPart, load_model, placement
from hsp_control.robot.description.mesh_files import find_file, places
from hsp_control.robot.description.recorded_meshes import (
    is_recorded,
    recorded_meshes,
    robot_meshes,
)
from hsp_control.robot.description.recorded_model import (
    model_data,
    model_of,
    packed,
    shapes_data,
    shapes_of,
    unpacked,
)
from hsp_control.robot.description.robot_description import OneRobot, RobotDescription
from hsp_control.robot.description.sources import PINOCCHIO, RobotSource
from hsp_control.robot.description.srdf import excluded_pairs
from hsp_control.robot.robot import Robot

_log = logging.getLogger(__name__)


def robot_record(robot: Robot) -> dict[str, Any]:
    """Return the record of a robot for a log, from which it is made without its files.

    It is the text of each URDF and the arguments of `Robot.load`, or the model itself
    if there is no such text. Where a robot cannot be recorded, it gives the reason.
    """
    try:
        description = robot.description
        if description is None or any(p.source.shapes is not None for p in robot.parts):
            return _model_record(robot)
        return {
            "description": plain_data(description),
            "home": _home(robot),
            "parts": [_text_record(robot, part) for part in robot.parts],
        }
    except HspControlError as error:
        return {"missing": str(error)}


def usable_record(meta: Mapping[str, Any]) -> Mapping[str, Any] | None:
    """Return a log's record of its robot; None if that is not enough to make it."""
    robot = meta.get("robot")
    record = robot.get("record") if isinstance(robot, Mapping) else None
    if not isinstance(record, Mapping) or "missing" in record:
        return None
    return record


def _home(robot: Robot) -> list[float]:
    home = robot.difference(robot.neutral(), robot.home())
    return [float(position) for position in home]


def _model_record(robot: Robot) -> dict[str, Any]:
    source = robot.source
    return {
        "model": model_data(robot.model),
        "name": robot.name,
        "root": source.root,
        "end_effector": robot.end_effector,
        "home": _home(robot),
        "shapes": shapes_data(source.shapes or ()),
        "excluded": sorted(sorted(pair) for pair in source.excluded),
    }


def _text_record(robot: Robot, part: RobotPart) -> dict[str, Any]:
    source = part.source
    text = text_of(source)
    frames = [each for each in robot.model.frames if each.type == pin.FrameType.BODY]
    links = [each.name.removeprefix(part.prefix) for each in frames]
    return {
        "name": source.name,
        "file": str(source.urdf),
        "urdf": packed(text),
        **robot_meshes(source, text),
        "root": source.root,
        "locked": dict(source.locked),
        "motor_inertia": dict(source.motor_inertia),
        "end_effector": source.end_effector,
        "joint_coordinates": source.joint_coordinates,
        "excluded": sorted(map(sorted, excluded_pairs(source, links))),
    }


def text_of(source: RobotSource) -> bytes:
    """Return the text of a robot's URDF."""
    if source.expanded is not None:
        return source.expanded.encode()
    try:
        return source.urdf.read_bytes()
    except OSError as error:
        raise ModelError(f"{source.urdf}: {error.strerror}") from None


def recorded_robot(record: Any, access: Access = ANYWHERE) -> Robot:
    """Return the robot of a log.

    It is the one that the log was made with: where the file of its URDF has changed
    since, a warning names it, as for the meshes that the log contains. Others are
    looked up beside that file, or in the robot's package.

    Args:
        record: The result of `robot_record`.
        access: Which files may be read.

    Raises:
        ModelError: If the log does not contain the robot, or it is damaged.
        AccessError: If a file that exists is not allowed.
    """
    if not isinstance(record, Mapping):
        raise ModelError("the log does not contain its robot")
    if "missing" in record:
        raise ModelError(f"the log does not contain its robot: {record['missing']}")
    try:
        if "model" in record:
            return _of_model(record)
        return _of_texts(record, access)
    except HspControlError:
        raise
    except (LookupError, TypeError, ValueError, AttributeError) as error:
        raise ModelError(f"the robot in the log is damaged: {error!r}") from None


def name_a_changed_scene(robot: Robot, record: Mapping[str, Any]) -> None:
    """Warn that the robot in a scene's file is not the one of a log."""
    if "model" in record and record["model"] != plain_data(model_data(robot.model)):
        _log.warning(
            "%s has changed since the log was made: the robot is that of the file",
            robot.source.urdf,
        )


class OtherRobotWarning(UserWarning):
    """The robot given for a log differs from the one in it."""


def warn_of_another_robot(robot: Robot, meta: Mapping[str, Any]) -> None:
    """Warn if the URDFs of a robot are not those in a log, for example edited since."""
    record, description = usable_record(meta), robot.description
    if record is None or description is None or "parts" not in record:
        return
    for part, then in zip(robot.parts, record["parts"], strict=False):
        with suppress(ModelError, LookupError, TypeError):  # a missing or damaged file
            if text_of(part.source) != unpacked(then["urdf"]):
                warn(
                    f"{part.source.urdf} is not the robot of the log: it was edited "
                    "since, or is another; load_experiment(log).robot is the log's",
                    OtherRobotWarning,
                )


def _of_model(record: Mapping[str, Any]) -> Robot:
    model = model_of(record["model"])
    name = str(record["name"])
    source = RobotSource(
        name=name,
        urdf=Path(name),
        root=record["root"],
        origin=PINOCCHIO,
        end_effector=record["end_effector"],
        home=tuple(map(float, record["home"])),
        shapes=shapes_of(record["shapes"]),
        excluded=frozenset(frozenset(pair) for pair in record["excluded"]),
    )
    return Robot(model, source)


class _Part(NamedTuple):
    """One of the robots that a description names."""

    told: OneRobot
    place: pin.SE3


def _of_texts(record: Mapping[str, Any], access: Access) -> Robot:
    description = RobotDescription(**record["description"])
    texts, gravity = record["parts"], description.gravity
    if description.parts is None:
        source = _source(texts[0], description, access)
        source = replace(source, home=tuple(map(float, record["home"])))
        model = load_model(source, description, gravity)
        return Robot(model, source, description=description)
    robots = {}
    for (name, part), text in zip(description.parts.items(), texts, strict=True):
        own = _source(text, part, access)
        model = load_model(own, part, gravity)
        robots[name] = Robot(model, own), placement(part.position, part.rotation)
    whole = Robot.combine(robots)
    source = replace(whole.source, home=tuple(map(float, record["home"])))
    return Robot(whole.model, source, whole.parts, description)


def _by_joint(values: Mapping[str, Any]) -> dict[str, float]:
    return {str(name): float(value) for name, value in values.items()}


def _source(record: Mapping[str, Any], told: OneRobot, access: Access) -> RobotSource:
    """Return the source of a text: its files are those of this computer."""
    text = unpacked(record["urdf"]).decode()
    try:
        there: RobotSource | None = told.find(access)
    except (ModelError, RobotNotFoundError):  # not on this computer
        there = None
    if there is not None:
        try:
            differs = text_of(there).decode(errors="replace") != text
        except ModelError:
            differs = False
        if differs:
            _log.warning(
                "%s has changed since the log was made: the robot is that of the log",
                there.urdf,
            )
    urdf = Path(str(record["file"])) if there is None else there.urdf
    # An untrusted log writes no files.
    meshes = {} if access.strict else recorded_meshes(record)
    source = RobotSource(
        name=str(record["name"]),
        urdf=urdf,
        root=record["root"],
        package_dirs=() if there is None else there.package_dirs,
        origin="file" if there is None else there.origin,
        locked=_by_joint(record["locked"]),
        motor_inertia=_by_joint(record.get("motor_inertia", {})),
        end_effector=record["end_effector"],
        joint_coordinates=record["joint_coordinates"],
        access=access,
        excluded=frozenset(frozenset(pair) for pair in record["excluded"]),
        expanded=text,
        meshes=tuple(meshes.items()),
    )
    _name_what_differs(source, record)
    return source


def _name_what_differs(source: RobotSource, record: Mapping[str, Any]) -> None:
    """Warn of meshes that have changed since, and of missing ones."""
    changed = [
        name
        for name, recorded in source.meshes
        if (file := next(filter(is_file, places(source, name)), None))
        and source.access.allows(file)
        and not is_recorded(file, recorded)
    ]
    if changed:
        _log.warning(
            "%s: meshes have changed since the log was made: those of the log are "
            "used: %s",
            source.name, listing(changed),
        )  # fmt: skip
    left_out = record.get("left_out", {})
    lacking = [name for name in left_out if find_file(source, name) is None]
    if lacking:
        _log.warning(
            "%s: the log does not contain these meshes, and they are not on this "
            "computer: %s",
            source.name, listing(f"{name} ({left_out[name]})" for name in lacking),
        )  # fmt: skip
