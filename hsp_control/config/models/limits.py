"""What efforts and motion are kept within."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Model, NonNegative, Number, Positive, Vector


class ScaledModel(Model):
    """The robot's own limit, times a number."""

    scale: Positive | Annotated[dict[str, Positive], Field(min_length=1)]
    """The number; 0.5 for a robot of half its strength. Or a number for each of some
    joints, by name: the others keep their own limits."""


Greatest = Literal["robot", "none"] | ScaledModel | Positive | list[Positive]


class PositionRangeModel(Model):
    """Joint positions in numbers."""

    lower: Vector
    """Least position of every freedom [rad or m]."""
    upper: Vector
    """Greatest position of every freedom [rad or m]."""


class ObstacleDistanceModel(Model):
    """How far links stay from obstacles."""

    type: Literal["obstacles"]
    least: NonNegative = 0.02
    """The least distance [m]."""
    obstacles: list[str] | None = None
    """Names of the obstacles; all by default."""
    links: list[str] | None = None
    """Names of the links; all that move by default."""


class SelfDistanceModel(Model):
    """How far links stay from each other."""

    type: Literal["self"]
    least: NonNegative = 0.01
    """The least distance [m]."""


AnyDistance = Annotated[
    ObstacleDistanceModel | SelfDistanceModel, Field(discriminator="type")
]


class LimitsModel(Model):
    """Limits that the controller keeps; the robot's own unless told otherwise."""

    effort: Greatest = "robot"
    """Greatest effort [N·m or N]."""
    effort_rate: Positive | list[Positive] | None = None
    """Greatest rate of effort [N·m/s or N/s]; a Panda's is 1000."""
    velocity: Greatest = "robot"
    """Greatest speed [rad/s or m/s]."""
    acceleration: Positive | list[Positive] | None = None
    """Greatest acceleration [rad/s² or m/s²]."""
    position: Literal["robot", "none"] | PositionRangeModel = "robot"
    """Joint positions [rad or m]."""
    position_margin: NonNegative = 0.005
    """How far inside its limits a position is kept [rad or m]."""
    velocity_margin: Annotated[Number, Field(ge=0.0, lt=1.0)] = 0.02
    """How far inside its limits a speed is kept, as a part of it."""
    distances: Annotated[list[AnyDistance], Field(default_factory=list)]
    """What must keep how far apart."""
    bandwidth: Positive = 10.0
    """Of the barriers before position and velocity limits [1/s]."""
    static_effort: Annotated[Number, Field(gt=0.0, le=1.0)] | None = None
    """The part of an effort that gravity may take, so that an arm goes only where its
    motors can hold it; for motors that bear no contact."""
    null_space_speed: Positive | list[Positive] | None = None
    """How fast the null space may leave the field, where limits bind, before tasks give
    way [rad/s or m/s]."""
    null_space_weight: Annotated[Number, Field(gt=0.0, lt=1.0)] | None = None
    """What null-space motion costs beside the first task, where limits bind: 1e-6, and
    1e-8 where tasks have priorities."""
