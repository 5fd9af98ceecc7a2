"""The null space: fields, metric and gain."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Gain, Model, Positive, Vector
from hsp_control.config.models.fields import AnyField


class IdentityModel(Model):
    """W = I: all joints have the same weight."""

    type: Literal["identity"]


class CoordinatesModel(Model):
    """W = AᵀA: Euclidean in the joint coordinates theta = A q."""

    type: Literal["coordinates"]
    matrix: list[Vector] | None = None
    """A [-], nv rows of nv numbers; by default as the robot's source defines it."""


class ConstantModel(Model):
    """A constant W."""

    type: Literal["constant"]
    matrix: list[Positive] | list[Vector]
    """W, nv rows of nv numbers, or its diagonal [-]."""


class MassMatrixModel(Model):
    """W = M(q): the kinetic-energy metric (dynamically consistent)."""

    type: Literal["mass_matrix"]


AnyMetric = Annotated[
    IdentityModel | CoordinatesModel | ConstantModel | MassMatrixModel,
    Field(discriminator="type"),
]


class NullSpaceModel(Model):
    """The control of self-motion."""

    gain: Gain = 10.0
    """Null-space gain K_N [1/s], the rate at which the null-space error decays: a
    number, nv numbers, or a matrix."""
    metric: AnyMetric = IdentityModel(type="identity")
    """The joint-space metric W."""
    fields: list[AnyField] = []
    """Fields; their sum is used. Without fields, self-motion comes to rest."""
    singularity_threshold: Positive = 0.03
    """Singular value of the task Jacobian below which its pseudo-inverse is damped
    [-]."""
