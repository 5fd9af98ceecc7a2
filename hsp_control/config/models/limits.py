"""Limits on efforts and motion."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Model, NonNegative, Number, Positive, Vector


class ScaledModel(Model):
    """The robot's own limit, multiplied by a factor."""

    scale: Positive | Annotated[dict[str, Positive], Field(min_length=1)]
    """The factor [-]; 0.5 halves the limit. Or factors by joint name; the other joints
    keep their own limits."""


Maximum = Literal["robot", "none"] | ScaledModel | Positive | list[Positive]


class PositionRangeModel(Model):
    """Joint position limits in numbers."""

    lower: Vector
    """Lower joint position limits, nv numbers [rad or m]."""
    upper: Vector
    """Upper joint position limits, nv numbers [rad or m]."""


class ObstacleDistanceModel(Model):
    """Minimum distance between links and obstacles."""

    type: Literal["obstacles"]
    least: NonNegative = 0.02
    """The minimum distance [m]."""
    obstacles: list[str] | None = None
    """Names of the obstacles; all by default."""
    links: list[str] | None = None
    """Names of the links; all moving links by default."""


class SelfDistanceModel(Model):
    """Minimum distance between links."""

    type: Literal["self"]
    least: NonNegative = 0.01
    """The minimum distance [m]."""


AnyDistance = Annotated[
    ObstacleDistanceModel | SelfDistanceModel, Field(discriminator="type")
]


class LimitsModel(Model):
    """Limits that the controller keeps; by default the robot's own."""

    effort: Maximum = "robot"
    """Maximum effort [N·m or N]: the robot's own, none, a factor, one number or nv."""
    effort_rate: Positive | list[Positive] | None = None
    """Maximum rate of the effort [N·m/s or N/s], one number or nv; a Panda's is
    1000."""
    velocity: Maximum = "robot"
    """Maximum speed [rad/s or m/s]: the robot's own, none, a factor, one number or
    nv."""
    acceleration: Positive | list[Positive] | None = None
    """Maximum acceleration [rad/s² or m/s²], one number or nv."""
    position: Literal["robot", "none"] | PositionRangeModel = "robot"
    """Joint position limits [rad or m]: the robot's own, none, or numbers."""
    position_margin: NonNegative = 0.005
    """Margin inside the position limits [rad or m]."""
    velocity_margin: Annotated[Number, Field(ge=0.0, lt=1.0)] = 0.02
    """Margin inside the speed limits, as a fraction of the limit [-]."""
    distances: Annotated[list[AnyDistance], Field(default_factory=list)]
    """Minimum distances."""
    bandwidth: Positive = 10.0
    """Bandwidth of the barriers at position and velocity limits [1/s]."""
    static_effort: Annotated[Number, Field(gt=0.0, le=1.0)] | None = None
    """Fraction of the effort limit that gravity may use [-], so that an arm stays where
    its motors can hold it; for motors that carry no contact. Unlimited by default."""
    null_space_speed: Positive | list[Positive] | None = None
    """How fast the null space may leave the field, where limits bind, before the tasks
    deviate [rad/s or m/s], one number or nv. Unlimited by default."""
    null_space_weight: Annotated[Number, Field(gt=0.0, lt=1.0)] | None = None
    """Cost of null-space deviation relative to the first task, where limits bind [-];
    1e-6 by default, 1e-8 if tasks have priorities."""
