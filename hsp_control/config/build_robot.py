"""Build the robot and its start; errors have a location."""

from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ConfigurationError
from hsp_control.config.document import Document
from hsp_control.config.models import robot as s
from hsp_control.config.scenario import Scenario
from hsp_control.declaration.keys import KeyPath
from hsp_control.robot import Robot
from hsp_control.robot.description.combining import placement
from hsp_control.robot.description.loading import ToolFrame

Loaded = TypeVar("Loaded", bound=s.LoadModel)


def build_robot(
    document: Document, scenario: Scenario, folder: Path
) -> tuple[Robot, Scenario]:
    """Return the robot, and the scenario with absolute paths.

    A relative path is first looked up in the configuration's folder, so that a folder
    with both can be moved. The log then contains the path of the file that was found.
    """
    model = scenario.robot
    if (model.name is None) == (model.parts is None):
        raise document.error(("robot",), "give one of name and parts")
    gravity = model.gravity
    if model.parts is None:
        found = located_model(model, folder)
        robot = load_robot(document, ("robot",), found, gravity)
    else:
        parts = {
            name: located_model(part, folder) for name, part in model.parts.items()
        }
        found = model.model_copy(update={"parts": parts})
        robots = {
            name: (
                load_robot(document, ("robot", "parts", name), part, gravity),
                placement(part.position, part.rpy),
            )
            for name, part in parts.items()
        }
        with document.at("robot", "parts"):
            robot = Robot.combine(robots)
    return robot, scenario.model_copy(update={"robot": found})


def located_model(model: Loaded, folder: Path) -> Loaded:
    """Return the model; a URDF in the configuration's folder gets its full path."""
    name = model.name or ""
    if name.endswith((".urdf", ".xml")) and _is_file(folder / name):
        return model.model_copy(update={"name": str(folder / name)})
    return model


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):  # too long for a path, or with a null character
        return False


def load_robot(
    document: Document, at: KeyPath, model: s.LoadModel, gravity: list[float] | None
) -> Robot:
    """Return the robot of a part of the configuration.

    Args:
        document: The configuration.
        at: The key path of the part.
        model: The part.
        gravity: Gravitational acceleration [m/s²]; None: the default.
    """
    if model.name is None:
        raise document.error(at, "missing key 'name'")
    tools = {
        tool: ToolFrame(frame.parent, frame.translation, frame.rpy)
        for tool, frame in model.tool_frames.items()
    }
    with document.at(*at, "name"):
        return Robot.load(
            model.name,
            root=model.root,
            locked=model.locked,
            tool_frames=tools,
            gravity=gravity,
            mimic=model.mimic,
            access=document.access,
        )


def build_start(document: Document, model: s.StartModel, robot: Robot) -> Array:
    """Return the start configuration, shape (nq,)."""
    given = [
        key
        for key in ("joints", "coordinates", "configuration")
        if getattr(model, key) is not None
    ]
    if len(given) > 1:
        raise document.error(
            ("start", given[1]),
            f"the start is given twice; give only one of {given[0]} and {given[1]}",
        )
    with document.at("start", *given):
        if model.configuration is not None:
            return robot.check_configuration(model.configuration)
        if model.coordinates is not None:
            A = robot.joint_coordinates
            if A is None:
                raise ConfigurationError(
                    f"{robot.name} defines no joint coordinates; use joints"
                )
            theta = robot.check_tangent(model.coordinates, "coordinates")
            joints = np.asarray(np.linalg.solve(A, theta))
            return robot.integrate(robot.neutral(), joints)
        if isinstance(model.joints, dict):
            return _moved_joints(document, robot, model.joints)
        if model.joints is not None:
            return joint_configuration(robot, model.joints, "joints")
    return robot.home()


def joint_configuration(robot: Robot, joints: Any, what: str) -> Array:
    """Return the configuration, shape (nq,), of joint positions, shape (nv,).

    Args:
        robot: The robot.
        joints: The joint positions [rad or m].
        what: Their name in messages.

    Raises:
        ShapeError: If there are not nv numbers.
    """
    return robot.integrate(robot.neutral(), robot.check_tangent(joints, what))


def _moved_joints(document: Document, robot: Robot, joints: dict[str, float]) -> Array:
    positions = robot.joint_positions(robot.home())
    for joint, value in joints.items():
        with document.at("start", "joints", joint):
            where = robot.velocity_index(joint)
            if where.stop - where.start != 1:
                raise ConfigurationError(
                    f"joint {joint!r} has {where.stop - where.start} degrees of "
                    "freedom; use start.configuration"
                )
        positions[where] = value
    return robot.integrate(robot.neutral(), positions)
