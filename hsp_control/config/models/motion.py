"""Trajectories of points, orientations and poses."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Model, Number, Positive, Vector, Vector3


class Moving(Model):
    """What all trajectories of a point share."""

    origin: Literal["world", "start"] = "world"
    """What points are given relative to: zero, or where the robot starts."""


class HoldModel(Moving):
    """Stand still."""

    type: Literal["hold"]
    point: Vector | None = None
    """Where; where the robot starts by default."""


class LineModel(Moving):
    """Move straight from rest to rest, by a quintic."""

    type: Literal["line"]
    start: Vector | None = None
    """First point; where the robot starts by default."""
    end: Vector
    """Last point."""
    duration: Positive
    """How long it takes [s]."""
    start_time: Number = 0.0
    """When it leaves [s]."""


class UniformLineModel(Moving):
    """Move straight for ever."""

    type: Literal["uniform_line"]
    start: Vector
    """The point at t = 0."""
    velocity: Vector
    """Its velocity."""


class CircleModel(Moving):
    """Go round a circle, in the plane or in space."""

    type: Literal["circle"]
    center: Vector
    """Its centre."""
    radius: Positive
    """Its radius [m]."""
    angular_rate: Number
    """How fast it is gone round [rad/s]."""
    phase: Number = 0.0
    """Where on it at t = 0 [rad]."""
    normal: Vector3 | None = None
    """In space: the direction that it is seen counter-clockwise from."""
    axes: Annotated[list[Vector], Field(min_length=2, max_length=2)] | None = None
    """In space, instead of the normal: the directions of phase 0 and of a quarter."""


class LissajousModel(Moving):
    """Swing along each axis: center + amplitude · sin(rate t + phase)."""

    type: Literal["lissajous"]
    center: Vector
    """The middle."""
    amplitudes: Vector
    """How far along each axis."""
    rates: Vector
    """How fast along each axis [rad/s]."""
    phases: Vector | None = None
    """Phase of each axis at t = 0 [rad]; zero by default."""


class MinimumJerkModel(Moving):
    """Pass through waypoints with the least jerk, from rest to rest."""

    type: Literal["minimum_jerk"]
    waypoints: Annotated[list[Vector], Field(min_length=2)]
    """The points."""
    times: Vector
    """When to be there [s]."""


class StopsModel(Moving):
    """Move straight from waypoint to waypoint, resting at each."""

    type: Literal["stops"]
    waypoints: Annotated[list[Vector], Field(min_length=2)]
    """The points; one twice is a pause."""
    times: Vector
    """When to be there [s]."""


class SplineModel(Moving):
    """Pass through waypoints along a spline, from rest to rest."""

    type: Literal["spline"]
    waypoints: Annotated[list[Vector], Field(min_length=2)]
    """The points."""
    times: Vector
    """When to be there [s]."""
    degree: Literal[3, 5, 7] = 5
    """Degree of the polynomials."""


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
    """Keep an orientation."""

    type: Literal["hold"]
    rpy: Vector3 | None = None
    """Roll, pitch and yaw in the world [rad]; as the robot starts by default."""


class SpinModel(Model):
    """Turn about a fixed axis at a constant rate."""

    type: Literal["spin"]
    axis: Vector3
    """The axis in the world."""
    rate: Number
    """How fast [rad/s]."""
    rpy: Vector3 | None = None
    """Orientation at t = 0 [rad]; as the robot starts by default."""


class OrientationPathModel(Model):
    """Turn the shortest way from one orientation to the next, resting at each."""

    type: Literal["path"]
    rpy: Annotated[list[Vector3], Field(min_length=2)]
    """The orientations, each as roll, pitch and yaw [rad]."""
    times: Vector
    """When to be there [s]."""


OrientationModel = Annotated[
    HoldOrientationModel | SpinModel | OrientationPathModel,
    Field(discriminator="type"),
]


class ComposedPoseModel(Model):
    """The origin follows one trajectory, the orientation another."""

    type: Literal["composed"]
    position: PointTrajectory
    """The origin's."""
    orientation: OrientationModel = HoldOrientationModel(type="hold")
    """The orientation's; held by default."""


class ScrewModel(Model):
    """Move along a straight screw, from where the robot starts, rest to rest."""

    type: Literal["screw"]
    position: Vector3
    """Last position in the world [m]."""
    rpy: Vector3
    """Last orientation [rad]."""
    duration: Positive
    """How long it takes [s]."""
    start_time: Number = 0.0
    """When it leaves [s]."""


PoseModel = Annotated[ComposedPoseModel | ScrewModel, Field(discriminator="type")]
