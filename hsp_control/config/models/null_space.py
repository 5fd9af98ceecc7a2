"""The null space: fields, metric and gain."""

from typing import Annotated, Literal

from pydantic import Field

from hsp_control.config.models.base import Gain, Model, Positive, Vector
from hsp_control.config.models.fields import AnyField


class IdentityModel(Model):
    """W = I: every joint's motion counts the same."""

    type: Literal["identity"]


class CoordinatesModel(Model):
    """W = AᵀA: Euclidean in the joint coordinates theta = A q."""

    type: Literal["coordinates"]
    matrix: list[Vector] | None = None
    """A; as the robot's source defines it by default."""


class ConstantModel(Model):
    """W constant."""

    type: Literal["constant"]
    matrix: list[Positive] | list[Vector]
    """W, or its diagonal."""


class MassMatrixModel(Model):
    """W = M(q): the kinetic-energy metric, dynamically consistent."""

    type: Literal["mass_matrix"]


AnyMetric = Annotated[
    IdentityModel | CoordinatesModel | ConstantModel | MassMatrixModel,
    Field(discriminator="type"),
]


class NullSpaceModel(Model):
    """Where self-motion goes, and how fast."""

    gain: Gain = 10.0
    """K_N [1/s]: a number, one per freedom, or a matrix."""
    metric: AnyMetric = IdentityModel(type="identity")
    """The joint-space metric."""
    fields: list[AnyField] = []
    """Fields, added up; at rest when there is none."""
    singularity_threshold: Positive = 0.03
    """Singular value of the tasks' Jacobian below which its inverse is bounded."""
