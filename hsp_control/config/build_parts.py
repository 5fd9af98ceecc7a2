"""Robot, start, tasks, fields and metric out of a configuration, each error located."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.arrays import Array
from hsp_control.config import scenario as s
from hsp_control.config.build_motion import (
    orientation_trajectory,
    pose_trajectory,
    position_trajectory,
)
from hsp_control.config.document import Document
from hsp_control.exceptions import (
    ConfigError,
    ConfigurationError,
    GainError,
    MetricError,
    TaskError,
)
from hsp_control.fields import (
    EqualJointAngles,
    JointCentering,
    NullSpaceField,
    PointDistance,
    Rest,
    TargetPosture,
    Uncontrolled,
    WeightedSum,
)
from hsp_control.loading import ToolFrame
from hsp_control.metrics import (
    ConstantMetric,
    IdentityMetric,
    MassMatrixMetric,
    Metric,
)
from hsp_control.robot import Robot, RobotState
from hsp_control.scene import Scene
from hsp_control.tasks import (
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    JointPosture,
    Pointing,
    Task,
)
from hsp_control.trajectories import (
    Blend,
    BlendOrientation,
    ComposedPose,
    HoldOrientation,
    OrientationTrajectory,
    PoseTrajectory,
    Trajectory,
)


def build_robot(
    document: Document, scenario: s.Scenario, folder: Path
) -> tuple[Robot, s.Scenario]:
    """Return the robot, and the scenario with its path made absolute.

    A relative path is looked up beside the configuration first, so that a folder with
    both can be moved; the log then names the file that was found.
    """
    model = scenario.robot
    name = model.name
    beside = folder / name
    if name.endswith((".urdf", ".xml")) and beside.is_file():
        name = str(beside)
        model = model.model_copy(update={"name": name})
        scenario = scenario.model_copy(update={"robot": model})
    tools = {
        tool: ToolFrame(frame.parent, frame.translation, frame.rpy)
        for tool, frame in model.tool_frames.items()
    }
    with document.at("robot"), document.at("robot", "name"):
        robot = Robot.load(
            name,
            root=model.root,
            locked=model.locked,
            tool_frames=tools,
            gravity=model.gravity,
            mimic=model.mimic,
        )
    return robot, scenario


def build_start(document: Document, model: s.StartModel, robot: Robot) -> Array:
    """Return the start configuration, shape (nq,)."""
    given = [
        key
        for key in ("joints", "coordinates", "configuration")
        if getattr(model, key) is not None
    ]
    if len(given) > 1:
        raise document.error(
            ("start", given[1]), f"the start is said twice: by {given[0]} already"
        )
    with document.at("start", *given):
        if model.configuration is not None:
            return robot.check_configuration(model.configuration)
        if model.coordinates is not None:
            A = robot.joint_coordinates
            if A is None:
                raise ConfigurationError(
                    f"{robot.name} has no joint coordinates of its own; use joints"
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
    """Return the configuration of given joint positions, shape (nv,)."""
    return robot.integrate(robot.neutral(), robot.check_tangent(joints, what))


def build_task(
    document: Document, name: str, model: s.AnyTask, start: RobotState
) -> Task:
    """Return one task; ``start`` is the robot where it starts."""
    robot = start.robot
    with document.at("tasks", name, "gains"):
        gains = _gains(model.gains)
    if isinstance(model, s.JointPostureModel):
        return _joint_posture(document, name, model, gains, start)
    with document.at("tasks", name, "frame"):
        frame = model.frame or robot.source.end_effector
        if frame is None:
            raise TaskError(
                f"name the frame: {robot.name} says of none that it is its end "
                f"effector (its last is {robot.frame_names[-1]!r})"
            )
        robot.frame_id(frame)
    here = start.frame(frame)
    with document.at("tasks", name):
        match model:
            case s.FramePositionModel():
                with document.at("tasks", name, "axes"):
                    axes = _axes(model.axes)
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
            case s.PointingModel():
                direction = HoldOrientation(_facing(model.direction))
                return Pointing(robot, frame, model.axis, direction, gains, name=name)


def build_metric(document: Document, model: s.AnyMetric, robot: Robot) -> Metric:
    """Return the joint-space metric."""
    with document.at("null_space", "metric"):
        match model:
            case s.IdentityModel():
                return IdentityMetric()
            case s.MassMatrixModel():
                return MassMatrixMetric()
            case s.ConstantModel():
                return ConstantMetric(_matrix(model.matrix))
            case s.CoordinatesModel():
                A = robot.joint_coordinates
                if model.matrix is not None:
                    A = _matrix(model.matrix)
                if A is None:
                    raise MetricError(
                        f"{robot.name} has no joint coordinates of its own; give matrix"
                    )
                return ConstantMetric.from_coordinates(A)


def build_fields(
    document: Document, models: list[s.AnyField], start: RobotState, scene: Scene
) -> NullSpaceField:
    """Return the sum of the fields, or rest when there is none."""
    terms = []
    for index, model in enumerate(models):
        with document.at("null_space", "fields", index):
            field = _field(document, index, model, start, scene)
            if not field.controls and len(models) > 1:
                raise ConfigError(
                    "an uncontrolled null space takes no other field beside it"
                )
        if len(models) == 1 and getattr(model, "weight", 1.0) == 1.0:
            return field
        terms.append((getattr(model, "weight", 1.0), field))
    return WeightedSum(terms) if terms else Rest(start.robot)


def _field(
    document: Document, index: int, model: s.AnyField, start: RobotState, scene: Scene
) -> NullSpaceField:
    robot = start.robot
    match model:
        case s.RestModel():
            return Rest(robot)
        case s.UncontrolledModel():
            return Uncontrolled(robot)
        case s.JointCenteringModel():
            return JointCentering(robot, weights=model.weights)
        case s.TargetPostureModel():
            with document.at("null_space", "fields", index, "target"):
                target = _posture(model.target, start)
            return TargetPosture(robot, target, weights=model.weights)
        case s.EqualJointAnglesModel():
            with document.at("null_space", "fields", index, "joints"):
                return EqualJointAngles(robot, model.joints)
        case s.PointDistanceModel():
            with document.at("null_space", "fields", index, "obstacle"):
                obstacle = scene[model.obstacle]
            with document.at("null_space", "fields", index, "frames"):
                return PointDistance(robot, model.frames, obstacle)


def _moved_joints(document: Document, robot: Robot, joints: dict[str, float]) -> Array:
    positions = robot.joint_positions(robot.home())
    for joint, value in joints.items():
        with document.at("start", "joints", joint):
            where = robot.velocity_index(joint)
            if where.stop - where.start != 1:
                raise ConfigurationError(
                    f"joint {joint!r} has {where.stop - where.start} freedoms; "
                    "use start.configuration"
                )
        positions[where] = value
    return robot.integrate(robot.neutral(), positions)


def _gains(model: s.GainsModel) -> Gains:
    stiff = model.kp is not None or model.kv is not None
    if stiff and (model.natural_frequency is not None or model.damping_ratio):
        raise GainError("give kp and kv, or natural_frequency and damping_ratio")
    if stiff:
        if model.kp is None or model.kv is None:
            raise GainError("kp and kv belong together; one is missing")
        return Gains(model.kp, model.kv)
    if model.natural_frequency is None:
        raise GainError("give kp and kv, or natural_frequency")
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
        reference = _posture(model.reference, start)
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


def _posture(value: Any, start: RobotState) -> Array:
    if value == "start":
        return start.q
    if value == "home":
        return start.robot.home()
    return joint_configuration(start.robot, value, "posture")


def _axes(letters: str) -> list[int]:
    if not letters or set(letters) - set("xyz") or len(set(letters)) < len(letters):
        raise TaskError(f"{letters!r}: name distinct axes among x, y and z")
    return ["xyz".index(letter) for letter in letters]


def _position(model: s.FramePositionModel, start: Array) -> Trajectory:
    trajectory = position_trajectory(model.trajectory, start)
    if model.blend is None:
        return trajectory
    return Blend(start, trajectory, model.blend)


def _orientation(model: s.FrameOrientationModel, start: Array) -> OrientationTrajectory:
    trajectory = orientation_trajectory(model.trajectory, start)
    if model.blend is None:
        return trajectory
    return BlendOrientation(start, trajectory, model.blend)


def _pose(model: s.FramePoseModel, start: pin.SE3) -> PoseTrajectory:
    trajectory = pose_trajectory(model.trajectory, start)
    if model.blend is None:
        return trajectory
    if not isinstance(trajectory, ComposedPose):
        raise TaskError("blend: a screw starts where the robot does; leave blend out")
    return ComposedPose(
        Blend(start.translation, trajectory.position, model.blend),
        BlendOrientation(start.rotation, trajectory.orientation, model.blend),
    )


def _facing(direction: list[float]) -> Array:
    """Return a rotation whose third axis is a direction."""
    z = np.asarray(direction)
    length = float(np.linalg.norm(z))
    if length == 0.0:
        raise TaskError("direction: [0, 0, 0] is none")
    x, y = np.linalg.svd(z[None, :] / length)[2][1:]
    rotation = np.column_stack([x, y, z / length])
    rotation[:, 0] *= np.sign(np.linalg.det(rotation))
    return rotation


def _matrix(rows: Any) -> Array:
    try:
        return np.array(rows, dtype=float)
    except ValueError:
        raise MetricError("the matrix's rows differ in length") from None
