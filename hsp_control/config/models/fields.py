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
    """Self-motion is not controlled: φ_N = 0. The paper warns against it."""

    type: Literal["uncontrolled"]


class RampModel(Model):
    """A weight that changes smoothly from one number to another."""

    initial: NonNegative = 0.0
    """Weight before the ramp [-]."""
    final: NonNegative
    """Weight after the ramp [-]."""
    start: Number = 0.0
    """Time at which the ramp begins [s]."""
    duration: Positive
    """Duration of the ramp [s]."""


class CostModel(Model):
    """Settings of all costs."""

    weight: NonNegative | RampModel = 1.0
    """Weight of the cost in the sum [-]: a number, or a ramp in time."""


class JointCenteringModel(CostModel):
    """Joints stay near the middle of their range."""

    type: Literal["joint_centering"]
    weights: Weights = 1.0
    """Weights of the joints [-], one number or nv."""


class LimitBarrierModel(CostModel):
    """Joints stay away from their limits; there is no cost elsewhere."""

    type: Literal["limit_barrier"]
    zone: Annotated[float, Field(gt=0.0, le=1.0)] = 0.3
    """Width of the zone before a limit, as a fraction of half the range [-]."""
    weights: Weights = 1.0
    """Weights of the joints [-], one number or nv."""


class TargetPostureModel(CostModel):
    """Joints move towards a posture."""

    type: Literal["target_posture"]
    target: Literal["start", "home"] | Vector = "start"
    """Joint positions, nv numbers [rad or m], or ``start`` or ``home``."""
    weights: Weights = 1.0
    """Weights of the joints [-], one number or nv."""


class EqualJointAnglesModel(CostModel):
    """Neighbouring joints bend by the same angle: Σ (q_{k+1} - q_k)²."""

    type: Literal["equal_joint_angles"]
    joints: Annotated[list[str], Field(min_length=2)]
    """Names of the joints, in order."""


class PointDistanceModel(CostModel):
    """Frames stay away from an obstacle's centre: Σ 1/d²."""

    type: Literal["point_distance"]
    frames: Annotated[list[str], Field(min_length=1)]
    """Names of the frames."""
    obstacle: str
    """Name of the obstacle in the scene."""


class JacobianModel(CostModel):
    """Settings of all costs of a frame's Jacobian."""

    frame: str | None = None
    """Name of the frame; the robot's end effector by default."""
    axes: str = "xyz"
    """World axes of the position rows of the Jacobian, such as ``xy``."""


class ManipulabilityModel(JacobianModel):
    """Manipulability of the frame: det(J Jᵀ), its root or its logarithm."""

    type: Literal["manipulability"]
    form: Literal["determinant", "root", "log"] = "root"
    """Function of det(J Jᵀ): the determinant itself, its square root, or its
    logarithm."""
    rows: Literal["position", "orientation", "pose"] = "position"
    """Rows of the Jacobian."""
    length: Positive = 1.0
    """Length that is equivalent to one radian [m], for rows of metres and radians."""


class InverseConditionModel(JacobianModel):
    """Isotropy of the frame: the inverse condition number of its Jacobian."""

    type: Literal["inverse_condition"]
    rows: Literal["position", "orientation", "pose"] = "position"
    """Rows of the Jacobian."""
    length: Positive = 1.0
    """Length that is equivalent to one radian [m], for rows of metres and radians."""


class TransmissionModel(JacobianModel):
    """Velocity or force transmission of the frame along one direction."""

    type: Literal["transmission"]
    direction: Annotated[list[Number], Field(min_length=1, max_length=3)]
    """The direction [-], one number for each of the axes."""
    kind: Literal["velocity", "force"] = "velocity"
    """Transmission of velocity (fast motion) or of force (large force)."""


class ObstacleClearanceModel(CostModel):
    """The links stay away from obstacles."""

    type: Literal["obstacle_clearance"]
    obstacles: list[str] | None = None
    """Names of the obstacles; all by default."""
    influence: Positive = 0.2
    """Distance at which the cost begins [m]."""
    links: list[str] | None = None
    """Names of the links; all moving links by default."""
    proxy: Literal["capsules", "spheres", "hulls", "meshes"] = "capsules"
    """Shapes that approximate the links."""


class SelfClearanceModel(CostModel):
    """The links stay away from each other."""

    type: Literal["self_clearance"]
    influence: Positive = 0.1
    """Distance at which the cost begins [m]."""
    proxy: Literal["capsules", "spheres", "hulls", "meshes"] = "capsules"
    """Shapes that approximate the links."""


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
