"""Obstacles and their shapes."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import (
    Model,
    Name,
    NonNegative,
    Positive,
    Vector,
    Vector3,
)
from hsp_control.config.models.motion import OrientationModel, PointTrajectory


class SphereModel(Model):
    """A ball; a disk in the plane."""

    type: Literal["sphere"]
    radius: NonNegative
    """Radius [m]."""


class CapsuleModel(Model):
    """A cylinder with round ends, along its z axis."""

    type: Literal["capsule"]
    radius: Positive
    """Radius [m]."""
    length: NonNegative
    """Distance between the centres of its ends [m]."""


class CylinderModel(Model):
    """A cylinder along its z axis."""

    type: Literal["cylinder"]
    radius: Positive
    """Radius [m]."""
    length: Positive
    """Height [m]."""


class BoxModel(Model):
    """A box."""

    type: Literal["box"]
    size: Annotated[list[Positive], Field(min_length=3, max_length=3)]
    """Lengths of its edges along x, y and z [m]."""


class PlaneModel(Model):
    """The half-space below its x-y plane: a floor, or a wall if it is turned."""

    type: Literal["plane"]


class MeshModel(Model):
    """A triangle mesh."""

    type: Literal["mesh"]
    file: str
    """An STL, OBJ or DAE file; relative paths begin at the configuration's folder."""
    scale: Positive = 1.0
    """Length of the file's unit [m]."""
    convex: bool = False
    """Whether its convex hull is used instead."""


class PointCloudModel(Model):
    """Measured points."""

    type: Literal["point_cloud"]
    points: Annotated[list[Vector3], Field(min_length=1)]
    """The points [m]."""
    resolution: Positive = 0.02
    """Edge of the cube that represents each point [m]."""


class HeightFieldModel(Model):
    """A terrain on a regular grid."""

    type: Literal["height_field"]
    size: Annotated[list[Positive], Field(min_length=2, max_length=2)]
    """Extent along x and y [m]."""
    heights: Annotated[list[Vector], Field(min_length=2)]
    """Heights [m], one row for each y."""


AnyShape = Annotated[
    SphereModel
    | CapsuleModel
    | CylinderModel
    | BoxModel
    | PlaneModel
    | MeshModel
    | PointCloudModel
    | HeightFieldModel,
    Field(discriminator="type"),
]


class ObstacleModel(Model):
    """A fixed or moving shape."""

    shape: AnyShape
    """The shape, centred at the obstacle's frame."""
    center: PointTrajectory
    """Trajectory of the frame's origin in the world, of dimension 3 [m]."""
    orientation: OrientationModel | None = None
    """Orientation of the frame; along the world's axes by default."""


class SceneModel(Model):
    """The obstacles in the robot's environment."""

    obstacles: Annotated[dict[Name, ObstacleModel], Field(max_length=1000)] = {}
    """Obstacles by name."""
