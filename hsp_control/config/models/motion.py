"""Trajectories of points, orientations and poses."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Model, Number, Positive, Vector, Vector3


class Moving(Model):
    """Settings of all trajectories of a point."""

    origin: Literal["world", "start"] = "world"
    """Origin of the given points: the world's origin, or the robot's start position."""


class HoldModel(Moving):
    """Hold a point."""

    type: Literal["hold"]
    point: Vector | None = None
    """The point [m, or the task's unit]; the robot's start position by default."""


class LineModel(Moving):
    """Move along a straight line from rest to rest, by a quintic polynomial."""

    type: Literal["line"]
    start: Vector | None = None
    """First point [m, or the task's unit]; the robot's start position by default."""
    end: Vector
    """Last point [m, or the task's unit]."""
    duration: Positive
    """Duration of the motion [s]."""
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""


class UniformLineModel(Moving):
    """Move along a straight line at constant velocity, without end."""

    type: Literal["uniform_line"]
    start: Vector
    """The point at t = 0 [m, or the task's unit]."""
    velocity: Vector
    """Its velocity [m/s, or the task's unit per s]."""


class CircleModel(Moving):
    """Move along a circle, in the plane or in space."""

    type: Literal["circle"]
    center: Vector
    """Centre of the circle [m]."""
    radius: Positive
    """Radius of the circle [m]."""
    angular_rate: Number
    """Angular rate along the circle [rad/s]."""
    phase: Number = 0.0
    """Angle on the circle at t = 0 [rad]."""
    normal: Vector3 | None = None
    """In space: normal of the circle's plane [-]; the motion is right-handed about
    it."""
    axes: Annotated[list[Vector], Field(min_length=2, max_length=2)] | None = None
    """In space, instead of the normal: the directions of angle 0 and of 90° [-]."""


class LissajousModel(Moving):
    """Oscillate along each axis: center + amplitude · sin(rate t + phase)."""

    type: Literal["lissajous"]
    center: Vector
    """Centre of the oscillation [m, or the task's unit]."""
    amplitudes: Vector
    """Amplitude along each axis [m, or the task's unit]."""
    rates: Vector
    """Angular frequency of each axis [rad/s]."""
    phases: Vector | None = None
    """Phase of each axis at t = 0 [rad]; zero by default."""


class MinimumJerkModel(Moving):
    """Pass through waypoints with minimum jerk, from rest to rest."""

    type: Literal["minimum_jerk"]
    waypoints: Annotated[list[Vector], Field(min_length=2)]
    """The waypoints [m, or the task's unit]."""
    times: Vector
    """Time at each waypoint [s], increasing."""


class StopsModel(Moving):
    """Move along straight lines from waypoint to waypoint, with a stop at each."""

    type: Literal["stops"]
    waypoints: Annotated[list[Vector], Field(min_length=2)]
    """The waypoints [m, or the task's unit]; the same point twice is a pause."""
    times: Vector
    """Time at each waypoint [s], increasing."""


class SplineModel(Moving):
    """Pass through waypoints along a spline, from rest to rest."""

    type: Literal["spline"]
    waypoints: Annotated[list[Vector], Field(min_length=2)]
    """The waypoints [m, or the task's unit]."""
    times: Vector
    """Time at each waypoint [s], increasing."""
    degree: Literal[3, 5, 7] = 5
    """Degree of the polynomials [-]."""


PointTrajectory = Annotated[
    HoldModel
    | LineModel
    | UniformLineModel
    | CircleModel
    | LissajousModel
    | MinimumJerkModel
    | StopsModel
    | SplineModel,
    Field(discriminator="type"),
]


class HoldOrientationModel(Model):
    """Hold an orientation."""

    type: Literal["hold"]
    rpy: Vector3 | None = None
    """Roll, pitch and yaw in the world [rad]; the robot's start orientation by
    default."""


class SpinModel(Model):
    """Turn about a fixed axis at a constant rate."""

    type: Literal["spin"]
    axis: Vector3
    """The axis in the world [-]."""
    rate: Number
    """Angular rate about the axis [rad/s]."""
    rpy: Vector3 | None = None
    """Roll, pitch and yaw at t = 0 [rad]; the robot's start orientation by default."""


class OrientationPathModel(Model):
    """Turn the shortest way from one orientation to the next, with a stop at each."""

    type: Literal["path"]
    rpy: Annotated[list[Vector3], Field(min_length=2)]
    """The orientations, each as roll, pitch and yaw [rad]."""
    times: Vector
    """Time at each waypoint [s], increasing."""


OrientationModel = Annotated[
    HoldOrientationModel | SpinModel | OrientationPathModel,
    Field(discriminator="type"),
]


class ComposedPoseModel(Model):
    """A pose made of a trajectory of the origin and one of the orientation."""

    type: Literal["composed"]
    position: PointTrajectory
    """Trajectory of the origin."""
    orientation: OrientationModel = HoldOrientationModel(type="hold")
    """Trajectory of the orientation; held by default."""


class ScrewModel(Model):
    """Move along a constant screw from the robot's start pose, from rest to rest."""

    type: Literal["screw"]
    position: Vector3
    """Final position in the world [m]."""
    rpy: Vector3
    """Final orientation: roll, pitch and yaw [rad]."""
    duration: Positive
    """Duration of the motion [s]."""
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""


PoseModel = Annotated[ComposedPoseModel | ScrewModel, Field(discriminator="type")]
