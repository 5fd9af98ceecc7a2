"""Build the tasks; errors have a location."""

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import GainError, TaskError
from hsp_control.config.build_motion import (
    orientation_trajectory,
    pose_trajectory,
    position_trajectory,
)
from hsp_control.config.build_robot import end_effector, posture
from hsp_control.config.document import Document
from hsp_control.config.models import tasks as s
from hsp_control.robot import RobotState
from hsp_control.tasks import (
    AngularMomentum,
    CenterOfMass,
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    JointPosture,
    Pointing,
    RelativePose,
    Task,
)
from hsp_control.tasks.axes import axis_indices
from hsp_control.trajectories import (
    Blend,
    BlendOrientation,
    ComposedPose,
    HoldOrientation,
    OrientationTrajectory,
    PoseTrajectory,
    Trajectory,
)


def build_task(
    document: Document, name: str, model: s.AnyTask, start: RobotState
) -> Task:
    """Return one task; ``start`` is the start state of the robot."""
    robot = start.robot
    with document.at("tasks", name, "gains"):
        gains = _gains(model.gains)
    if isinstance(model, s.JointPostureModel):
        return _joint_posture(document, name, model, gains, start)
    if isinstance(model, s.CenterOfMassModel | s.AngularMomentumModel):
        return _whole_body(document, name, model, gains, start)
    frame = end_effector(document, ("tasks", name), model.frame, robot)
    here = start.frame(frame)
    with document.at("tasks", name):
        match model:
            case s.FramePositionModel():
                with document.at("tasks", name, "axes"):
                    axes = axis_indices(model.axes)
                with document.at("tasks", name, "trajectory"):
                    position = _position(model, here.position[axes])
                return FramePosition(
                    robot, frame, position, gains, axes=model.axes, name=name
                )
            case s.FrameOrientationModel():
                with document.at("tasks", name, "trajectory"):
                    orientation = _orientation(model, here.rotation)
                return FrameOrientation(robot, frame, orientation, gains, name=name)
            case s.FramePoseModel():
                with document.at("tasks", name, "trajectory"):
                    pose = _pose(model, pin.SE3(here.rotation, here.position))
                return FramePose(robot, frame, pose, gains, name=name)
            case s.RelativePoseModel():
                with document.at("tasks", name, "reference"):
                    seen_from = start.frame(model.reference)
                with document.at("tasks", name, "trajectory"):
                    there = pin.SE3(seen_from.rotation, seen_from.position)
                    seen = there.actInv(pin.SE3(here.rotation, here.position))
                    pose = _pose(model, seen)
                return RelativePose(
                    robot, frame, model.reference, pose, gains, name=name
                )
            case s.PointingModel():
                direction = HoldOrientation(_facing(model.direction))
                return Pointing(robot, frame, model.axis, direction, gains, name=name)


def _whole_body(
    document: Document,
    name: str,
    model: s.CenterOfMassModel | s.AngularMomentumModel,
    gains: Gains,
    start: RobotState,
) -> Task:
    robot = start.robot
    if isinstance(model, s.AngularMomentumModel):
        with document.at("tasks", name, "trajectory"):
            momentum = position_trajectory(model.trajectory, np.zeros(3))
        with document.at("tasks", name):
            return AngularMomentum(robot, momentum, model.rate, name=name)
    with document.at("tasks", name, "axes"):
        axes = axis_indices(model.axes)
    with document.at("tasks", name, "trajectory"):
        position = _position(model, start.centroidal.position[axes])
    with document.at("tasks", name):
        return CenterOfMass(robot, position, gains, axes=model.axes, name=name)


def _gains(model: s.GainsModel) -> Gains:
    stiff = model.kp is not None or model.kv is not None
    if stiff and (model.natural_frequency is not None or model.damping_ratio):
        raise GainError("give either kp and kv, or natural_frequency and damping_ratio")
    if stiff:
        if model.kp is None or model.kv is None:
            raise GainError("give both kp and kv; one of them is missing")
        return Gains(model.kp, model.kv)
    if model.natural_frequency is None:
        raise GainError("give either kp and kv, or natural_frequency")
    ratio = 1.0 if model.damping_ratio is None else model.damping_ratio
    return Gains.from_frequency(model.natural_frequency, ratio)


def _joint_posture(
    document: Document,
    name: str,
    model: s.JointPostureModel,
    gains: Gains,
    start: RobotState,
) -> Task:
    with document.at("tasks", name, "reference"):
        reference = posture(model.reference, start)
    displacement = None
    if model.displacement is not None:
        with document.at("tasks", name, "displacement"):
            displacement = position_trajectory(model.displacement, None)
    with document.at("tasks", name):
        return JointPosture(
            start.robot,
            reference,
            gains,
            displacement=displacement,
            joints=model.joints,
            name=name,
        )


def _position(
    model: s.FramePositionModel | s.CenterOfMassModel, start: Array
) -> Trajectory:
    trajectory = position_trajectory(model.trajectory, start)
    if model.blend is None:
        return trajectory
    return Blend(start, trajectory, model.blend)


def _orientation(model: s.FrameOrientationModel, start: Array) -> OrientationTrajectory:
    trajectory = orientation_trajectory(model.trajectory, start)
    if model.blend is None:
        return trajectory
    return BlendOrientation(start, trajectory, model.blend)


def _pose(
    model: s.FramePoseModel | s.RelativePoseModel, start: pin.SE3
) -> PoseTrajectory:
    trajectory = pose_trajectory(model.trajectory, start)
    if model.blend is None:
        return trajectory
    if not isinstance(trajectory, ComposedPose):
        raise TaskError("blend: a screw begins at the robot's start; remove blend")
    return ComposedPose(
        Blend(start.translation, trajectory.position, model.blend),
        BlendOrientation(start.rotation, trajectory.orientation, model.blend),
    )


def _facing(direction: list[float]) -> Array:
    """Return a rotation whose third axis is a direction."""
    z = np.asarray(direction)
    length = float(np.linalg.norm(z))
    if length == 0.0:
        raise TaskError("direction must be non-zero, got [0, 0, 0]")
    x, y = np.linalg.svd(z[None, :] / length)[2][1:]
    rotation = np.column_stack([x, y, z / length])
    rotation[:, 0] *= np.sign(np.linalg.det(rotation))
    return rotation
