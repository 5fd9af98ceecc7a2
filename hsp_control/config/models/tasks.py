"""Tasks and their gains."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Gain, Model, Positive, Vector, Vector3
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


class TaskModel(Model):
    """What all tasks share."""

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
    | JointPostureModel,
    Field(discriminator="type"),
]
