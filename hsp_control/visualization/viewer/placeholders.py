"""Placeholders for missing visuals: a capsule per link, a drum per joint."""

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import JOINT, LINK
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.materials import material
from hsp_control.visualization.viewer.poses import pose_along

_THICKNESS = 0.034
"""A link's radius at the base, over the robot's reach."""
_TAPER = 0.55
"""The radius at the last joint, over that at the base."""


def placeholder(robot: Robot, joint: int) -> Json | None:
    """Return a drum at a joint and capsules to its children; None if there are none."""
    radius = _radius(robot, joint)
    surface = material(LINK, glow=0.5)
    things = [_drum(robot, joint, radius)] if joint else _feet(robot, radius)
    for start, end, end_radius in _links(robot, joint):
        length = float(np.linalg.norm(end - start))
        if length > radius:
            body = threejs.capsule(length, 0.8 * radius, 0.8 * end_radius)
            pose = pose_along(end - start)
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
        start = np.zeros(3) if joint else _base(robot, model.names[child])
        end = model.jointPlacements[child].translation
        yield start, end, _radius(robot, child)
    if joint and not children:
        tips = [f.placement.translation for f in model.frames if f.parentJoint == joint]
        tip = max(tips, key=lambda point: float(np.linalg.norm(point)))
        if not np.any(tip):
            tip = model.inertias[joint].lever
        yield np.zeros(3), tip, _TAPER * _radius(robot, joint)


def _base(robot: Robot, joint: str) -> Array:
    """Return the base position [m] of the robot that a joint belongs to."""
    part = next(part for part in robot.parts if joint.startswith(part.prefix))
    place: Array = part.placement.translation
    return place


def _feet(robot: Robot, radius: float) -> list[Json]:
    """Return the base plates of robots that are fixed to the ground."""
    surface = material(JOINT)
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
    surface = material(JOINT)
    model = robot.model
    if model.joints[joint].nv != 1:
        return threejs.mesh(threejs.sphere(1.15 * radius), surface)
    data = model.createData()
    pin.computeJointJacobians(model, data, robot.neutral())
    motion = np.asarray(data.joints[joint].S).reshape(6, -1)[:, 0]
    turns = bool(np.any(motion[3:]))
    pose = pose_along(motion[3:] if turns else motion[:3])
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
    return _THICKNESS * reach(robot) * (1.0 - (1.0 - _TAPER) * fraction)


def reach(robot: Robot) -> float:
    """Return the length of the longest chain of links [m]."""
    model = robot.model
    lengths = np.zeros(model.njoints)
    for joint in range(2, model.njoints):
        parent = model.parents[joint]
        step = np.linalg.norm(model.jointPlacements[joint].translation)
        lengths[joint] = lengths[parent] + step
    for frame in model.frames:
        tip = lengths[frame.parentJoint] + np.linalg.norm(frame.placement.translation)
        if frame.parentJoint > 0:
            lengths[0] = max(lengths[0], tip)
    return float(lengths.max()) or 1.0
