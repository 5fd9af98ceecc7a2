"""Contacts of the robot with its environment."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Model, Positive, Vector3
from hsp_control.config.models.tasks import ScheduleModel


class ContactModel(Model):
    """Settings of all contacts."""

    frame: str
    """Name of the frame in contact."""
    friction: Positive = 0.7
    """Coulomb friction coefficient μ [-]."""
    normal: Vector3 = [0.0, 0.0, 1.0]
    """Normal of the contact plane in the world, of any length [-]."""
    damping: Positive = 40.0
    """Rate at which a remaining velocity of the contact decays [1/s]."""
    schedule: ScheduleModel | None = None
    """When the contact is active; always by default."""


class SurfaceContactModel(ContactModel):
    """A flat sole in contact: it neither moves nor turns."""

    type: Literal["surface"]
    length: Positive | None = None
    """Length of a rectangular sole along the frame's x axis [m]."""
    width: Positive | None = None
    """Width of a rectangular sole along the frame's y axis [m]."""
    center: Vector3 = [0.0, 0.0, 0.0]
    """Centre of the rectangular sole in the frame [m]."""
    corners: Annotated[list[Vector3], Field(min_length=3)] | None = None
    """Corners of the sole in the frame [m], instead of length and width."""


class PointContactModel(ContactModel):
    """A point in contact: it does not move, but the frame may turn about it."""

    type: Literal["point"]
    point: Vector3 = [0.0, 0.0, 0.0]
    """The point in the frame's coordinates [m]."""


class BallContactModel(ContactModel):
    """A ball rolls without slipping."""

    type: Literal["ball"]
    radius: Positive
    """Radius of the ball, whose centre is the frame's origin [m]."""


AnyContact = Annotated[
    SurfaceContactModel | PointContactModel | BallContactModel,
    Field(discriminator="type"),
]
