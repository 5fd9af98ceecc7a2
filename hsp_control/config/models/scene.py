"""Obstacles."""

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
    """A ball; in the plane, a disk."""

    type: Literal["sphere"]
    radius: NonNegative
    """Its radius [m]."""


class CapsuleModel(Model):
    """A cylinder with round ends, along its z axis."""

    type: Literal["capsule"]
    radius: Positive
    """Its radius [m]."""
    length: NonNegative
    """Between the centres of its ends [m]."""


class CylinderModel(Model):
    """A cylinder along its z axis."""

    type: Literal["cylinder"]
    radius: Positive
    """Its radius [m]."""
    length: Positive
    """Its height [m]."""


class BoxModel(Model):
    """A box."""

    type: Literal["box"]
    size: Annotated[list[Positive], Field(min_length=3, max_length=3)]
    """Its edges [m]."""


class PlaneModel(Model):
    """All below its own x-y plane: a floor, or a wall when it is turned."""

    type: Literal["plane"]


class MeshModel(Model):
    """A triangle mesh."""

    type: Literal["mesh"]
    file: str
    """An STL, OBJ or DAE file, looked up beside the configuration."""
    scale: Positive = 1.0
    """What its numbers are worth [m]."""
    convex: bool = False
    """Whether its convex hull stands for it."""


class PointCloudModel(Model):
    """Measured points."""

    type: Literal["point_cloud"]
    points: Annotated[list[Vector3], Field(min_length=1)]
    """The points [m]."""
    resolution: Positive = 0.02
    """Edge of the cube that each is grown to [m]."""


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
    """A shape that stands or moves."""

    shape: AnyShape
    """Its form, centred on its own frame."""
    center: PointTrajectory
    """Where its frame is in the world, of dimension 3."""
    orientation: OrientationModel | None = None
    """How its frame is turned; along the world's axes by default."""


class SceneModel(Model):
    """What stands or moves in the robot's world."""

    obstacles: Annotated[dict[Name, ObstacleModel], Field(max_length=1000)] = {}
    """Obstacles by name."""
