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
    """Kp and Kv of e'' + Kv e' + Kp e = 0, or the frequency and damping they mean."""

    kp: Gain | None = None
    """Stiffness [1/s²]: a number, one per row, or a matrix."""
    kv: Gain | None = None
    """Damping [1/s]: a number, one per row, or a matrix."""
    natural_frequency: Gain | None = None
    """ω0 [rad/s], instead of kp and kv."""
    damping_ratio: Gain | None = None
    """ζ [-]; 1, critical, by default."""


class ScheduleModel(Model):
    """When something is on."""

    intervals: Annotated[
        list[Annotated[list[Number | None], Field(min_length=2, max_length=2)]],
        Field(min_length=1),
    ]
    """[from, until] of each interval [s]; null where it has always been, or stays."""
    ramp: NonNegative = 0.3
    """How long each rise and each fall takes, inside the intervals [s]."""


class TaskModel(Model):
    """What all tasks share."""

    priority: Annotated[int, Field(ge=1)] = 1
    """1 is the highest; tasks of one priority share a level."""
    schedule: ScheduleModel | None = None
    """When it counts; always by default."""
    gains: GainsModel = GainsModel(natural_frequency=10.0)
    """Feedback gains; critically damped at 10 rad/s by default."""


class Blended(TaskModel):
    """What all tasks with a trajectory share."""

    blend: Positive | None = None
    """How long the reference takes from the robot's start into the trajectory [s]."""


class FramePositionModel(Blended):
    """A frame's origin follows a point."""

    type: Literal["frame_position"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    axes: str = "xyz"
    """World axes that are tracked."""
    trajectory: PointTrajectory
    """Where to."""


class FrameOrientationModel(Blended):
    """A frame's orientation follows another."""

    type: Literal["frame_orientation"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    trajectory: OrientationModel
    """Where to."""


class FramePoseModel(Blended):
    """A frame follows a pose."""

    type: Literal["frame_pose"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    trajectory: PoseModel
    """Where to."""


class PointingModel(TaskModel):
    """An axis of a frame points along a direction."""

    type: Literal["pointing"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    axis: Vector3 = [0.0, 0.0, 1.0]
    """The axis in the frame."""
    direction: Vector3
    """The direction in the world."""


class CenterOfMassModel(Blended):
    """The centre of mass follows a point."""

    type: Literal["center_of_mass"]
    axes: str = "xyz"
    """World axes that are tracked."""
    trajectory: PointTrajectory
    """Where to."""


class AngularMomentumModel(TaskModel):
    """The angular momentum about the centre of mass, per mass, follows a point."""

    type: Literal["angular_momentum"]
    rate: Positive = 10.0
    """K of e' + K e = 0 [1/s]; `gains` are not used, for want of a second order."""
    trajectory: PointTrajectory
    """Where to [m²/s]."""


class RelativePoseModel(Blended):
    """A frame follows a pose as seen from another."""

    type: Literal["relative_pose"]
    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    reference: str
    """Name of the frame that it is seen from."""
    trajectory: PoseModel
    """Where to, in the reference's axes."""


class JointPostureModel(TaskModel):
    """Joints follow a posture."""

    type: Literal["joint_posture"]
    reference: Literal["start", "home"] | Vector = "start"
    """Joint positions [rad or m], nv of them; where the robot starts by default."""
    joints: Annotated[list[str], Field(min_length=1)] | None = None
    """Names of the joints; all by default."""
    displacement: PointTrajectory | None = None
    """Motion about the reference [rad or m]."""


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
