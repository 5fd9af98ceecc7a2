"""Null-space fields."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import (
    Model,
    NonNegative,
    Number,
    Positive,
    Vector,
    Weights,
)


class RestModel(Model):
    """Self-motion comes to rest: g = 0."""

    type: Literal["rest"]


class UncontrolledModel(Model):
    """Self-motion is left alone: φ_N = 0, the paper's warning."""

    type: Literal["uncontrolled"]


class RampModel(Model):
    """A weight that goes smoothly from one number to another."""

    initial: NonNegative = 0.0
    """Before."""
    final: NonNegative
    """After."""
    start: Number = 0.0
    """When it begins [s]."""
    duration: Positive
    """How long it takes [s]."""


class CostModel(Model):
    """What all costs share."""

    weight: NonNegative | RampModel = 1.0
    """Its weight in the sum, a number or a ramp in time."""


class JointCenteringModel(CostModel):
    """Joints keep near the middle of their range."""

    type: Literal["joint_centering"]
    weights: Weights = 1.0
    """Weights of the joints, one number or nv."""


class LimitBarrierModel(CostModel):
    """Joints keep off their limits, and are left alone elsewhere."""

    type: Literal["limit_barrier"]
    zone: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """Where it begins, as a fraction of half the range."""
    weights: Weights = 1.0
    """Weights of the joints, one number or nv."""


class TargetPostureModel(CostModel):
    """Joints are drawn to a posture."""

    type: Literal["target_posture"]
    target: Literal["start", "home"] | Vector = "start"
    """Joint positions [rad or m], nv of them; where the robot starts by default."""
    weights: Weights = 1.0
    """Weights of the joints, one number or nv."""


class EqualJointAnglesModel(CostModel):
    """Neighbouring joints bend by the same angle: Σ (q_{k+1} - q_k)²."""

    type: Literal["equal_joint_angles"]
    joints: Annotated[list[str], Field(min_length=2)]
    """Names of the joints in order."""


class PointDistanceModel(CostModel):
    """Frames keep away from an obstacle's centre: Σ 1/d²."""

    type: Literal["point_distance"]
    frames: Annotated[list[str], Field(min_length=1)]
    """Names of the frames."""
    obstacle: str
    """Name of the obstacle in the scene."""


class JacobianModel(CostModel):
    """What all costs of a frame's Jacobian share."""

    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    axes: str = "xyz"
    """World axes of its position rows."""


class ManipulabilityModel(JacobianModel):
    """The frame stays able to move every way: det(J Jᵀ), its root or its logarithm."""

    type: Literal["manipulability"]
    form: Literal["determinant", "root", "log"] = "root"
    """Which function of det(J Jᵀ)."""
    rows: Literal["position", "orientation", "pose"] = "position"
    """Which rows of its Jacobian."""
    length: Positive = 1.0
    """What one radian is worth [m], where rows mix metres and radians."""


class InverseConditionModel(JacobianModel):
    """The frame stays equally able to move every way."""

    type: Literal["inverse_condition"]
    rows: Literal["position", "orientation", "pose"] = "position"
    """Which rows of its Jacobian."""
    length: Positive = 1.0
    """What one radian is worth [m], where rows mix metres and radians."""


class TransmissionModel(JacobianModel):
    """The frame stays quick, or strong, along one direction."""

    type: Literal["transmission"]
    direction: Annotated[list[Number], Field(min_length=1, max_length=3)]
    """The direction, one number for each of the axes."""
    kind: Literal["velocity", "force"] = "velocity"
    """Whether it shall be quick or strong."""


class ObstacleClearanceModel(CostModel):
    """The links keep clear of obstacles."""

    type: Literal["obstacle_clearance"]
    obstacles: list[str] | None = None
    """Names of the obstacles; all by default."""
    influence: Positive = 0.2
    """Distance at which the cost begins [m]."""
    links: list[str] | None = None
    """Names of the links; all that move by default."""
    proxy: Literal["capsules", "spheres", "hulls", "meshes"] = "capsules"
    """What stands for the links."""


class SelfClearanceModel(CostModel):
    """The links keep clear of each other."""

    type: Literal["self_clearance"]
    influence: Positive = 0.1
    """Distance at which the cost begins [m]."""
    proxy: Literal["capsules", "spheres", "hulls", "meshes"] = "capsules"
    """What stands for the links."""


AnyField = Annotated[
    RestModel
    | UncontrolledModel
    | JointCenteringModel
    | LimitBarrierModel
    | ManipulabilityModel
    | InverseConditionModel
    | TransmissionModel
    | ObstacleClearanceModel
    | SelfClearanceModel
    | TargetPostureModel
    | EqualJointAnglesModel
    | PointDistanceModel,
    Field(discriminator="type"),
]
