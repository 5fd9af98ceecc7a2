"""Where a robot rests on the world."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Model, Positive, Vector3
from hsp_control.config.models.tasks import ScheduleModel


class ContactModel(Model):
    """What all contacts share."""

    frame: str
    """The frame that rests."""
    friction: Positive = 0.7
    """Coulomb's coefficient μ."""
    normal: Vector3 = [0.0, 0.0, 1.0]
    """The plane's normal in the world."""
    damping: Positive = 40.0
    """How fast what still moves comes to rest [1/s]."""
    schedule: ScheduleModel | None = None
    """When it bears; always by default."""


class SurfaceContactModel(ContactModel):
    """A flat sole rests: it neither moves nor turns."""

    type: Literal["surface"]
    length: Positive | None = None
    """Of a rectangular sole along the frame's x [m]."""
    width: Positive | None = None
    """Of a rectangular sole along the frame's y [m]."""
    center: Vector3 = [0.0, 0.0, 0.0]
    """Its middle in the frame [m]."""
    corners: Annotated[list[Vector3], Field(min_length=3)] | None = None
    """Instead of length and width: the corners in the frame [m]."""


class PointContactModel(ContactModel):
    """A point rests and may turn about itself."""

    type: Literal["point"]
    point: Vector3 = [0.0, 0.0, 0.0]
    """The point in the frame [m]."""


class BallContactModel(ContactModel):
    """A ball rolls without slipping."""

    type: Literal["ball"]
    radius: Positive
    """Of the ball about the frame's origin [m]."""


AnyContact = Annotated[
    SurfaceContactModel | PointContactModel | BallContactModel,
    Field(discriminator="type"),
]
