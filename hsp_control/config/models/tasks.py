"""Tasks and their gains."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import (
    Gain,
    Model,
    NonNegative,
    Number,
    Positive,
    Vector,
    Vector3,
)
from hsp_control.config.models.motion import (
    OrientationModel,
    PointTrajectory,
    PoseModel,
)


class GainsModel(Model):
    """Kp and Kv of e'' + Kv e' + Kp e = 0, or natural frequency and damping ratio."""

    kp: Gain | None = None
    """Stiffness [1/s²]: a number, one per row, or a matrix."""
    kv: Gain | None = None
    """Damping [1/s]: a number, one per row, or a matrix."""
    natural_frequency: Gain | None = None
    """ω0 [rad/s], instead of kp and kv: a number, one per row, or a matrix."""
    damping_ratio: Gain | None = None
    """ζ [-]; 1 (critical damping) by default."""


class ScheduleModel(Model):
    """The time intervals in which a task or contact is active."""

    intervals: Annotated[
        list[Annotated[list[Number | None], Field(min_length=2, max_length=2)]],
        Field(min_length=1),
    ]
    """[begin, end] of each interval [s]; null for no begin or no end."""
    ramp: NonNegative = 0.3
    """Duration of each fade-in and fade-out, inside the intervals [s]."""


class TaskModel(Model):
    """Settings of all tasks."""

    priority: Annotated[int, Field(ge=1)] = 1
    """Priority [-]; 1 is the highest. Tasks of the same priority form one level."""
    schedule: ScheduleModel | None = None
    """When the task is active; always by default."""
    gains: GainsModel = GainsModel(natural_frequency=10.0)
    """Feedback gains; critically damped at 10 rad/s by default."""


class Blended(TaskModel):
    """Settings of all tasks with a trajectory."""

    blend: Positive | None = None
    """Duration of the transition from the robot's start to the trajectory [s]; none by
    default."""


class FramePositionModel(Blended):
    """A frame's origin follows a trajectory."""

    type: Literal["frame_position"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    axes: str = "xyz"
    """World axes that are tracked, such as ``xy``."""
    trajectory: PointTrajectory
    """The trajectory of the origin [m]."""


class FrameOrientationModel(Blended):
    """A frame's orientation follows a trajectory."""

    type: Literal["frame_orientation"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    trajectory: OrientationModel
    """The trajectory of the orientation [rad]."""


class FramePoseModel(Blended):
    """A frame's pose follows a trajectory."""

    type: Literal["frame_pose"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    trajectory: PoseModel
    """The trajectory of the pose [m, rad]."""


class PointingModel(TaskModel):
    """An axis of a frame points along a direction."""

    type: Literal["pointing"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    axis: Vector3 = [0.0, 0.0, 1.0]
    """The axis in the frame's coordinates, of any length [-]."""
    direction: Vector3
    """The direction in the world, of any length [-]."""


class CenterOfMassModel(Blended):
    """The centre of mass follows a trajectory."""

    type: Literal["center_of_mass"]
    axes: str = "xyz"
    """World axes that are tracked, such as ``xy``."""
    trajectory: PointTrajectory
    """The trajectory of the centre of mass [m]."""


class AngularMomentumModel(TaskModel):
    """The angular momentum about the centre of mass, per mass, follows a trajectory."""

    type: Literal["angular_momentum"]
    rate: Positive = 10.0
    """K of e' + K e = 0 [1/s]; `gains` are not used, the task is of first order."""
    trajectory: PointTrajectory
    """The trajectory of the angular momentum per mass [m²/s]."""


class RelativePoseModel(Blended):
    """A frame's pose relative to another frame follows a trajectory."""

    type: Literal["relative_pose"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    reference: str
    """Name of the frame that the pose is relative to."""
    trajectory: PoseModel
    """The trajectory of the pose, in the reference frame [m, rad]."""


class JointPostureModel(TaskModel):
    """Joints follow a posture."""

    type: Literal["joint_posture"]
    reference: Literal["start", "home"] | Vector = "start"
    """Joint positions, nv numbers [rad or m], or ``start`` or ``home``."""
    joints: Annotated[list[str], Field(min_length=1)] | None = None
    """Names of the joints; all by default."""
    displacement: PointTrajectory | None = None
    """Motion relative to the reference [rad or m], one number for each of the
    joints."""


AnyTask = Annotated[
    FramePositionModel
    | FrameOrientationModel
    | FramePoseModel
    | PointingModel
    | CenterOfMassModel
    | AngularMomentumModel
    | RelativePoseModel
    | JointPostureModel,
    Field(discriminator="type"),
]
