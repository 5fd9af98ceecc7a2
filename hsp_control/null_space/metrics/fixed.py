"""Metrics that are the same at all configurations."""

from abc import abstractmethod
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import MetricError
from hsp_control.common.step_plan import StepPlan
from hsp_control.declaration import within
from hsp_control.declaration.quantities import ArrayField, Matrix, Number, read_only
from hsp_control.geometry.start import Start
from hsp_control.law import CONSTANT, IDENTITY, MetricSample
from hsp_control.null_space.metrics.metric import Metric
from hsp_control.robot import RobotState


class FixedMetric(Metric):
    """W = const, symmetric positive definite.

    A subclass has a field ``matrix``, and implements `_matrix`.
    """

    form: ClassVar[int] = CONSTANT

    @abstractmethod
    def _matrix(self) -> Array:
        """Return W, shape (nv, nv); `W` checks it."""

    @cached_property
    def W(self) -> Array:
        """The matrix, read-only, shape (nv, nv)."""
        matrix = self._matrix()
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
            raise MetricError(f"the metric has shape {matrix.shape}; needs (nv, nv)")
        if not np.isfinite(matrix).all():
            raise MetricError("the metric contains NaN or inf")
        if np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max():
            raise MetricError("the metric is not symmetric")
        values = np.linalg.eigvalsh(matrix)
        if values[0] <= 1e-12 * values[-1]:  # a zero may be computed as about 1e-16
            raise MetricError(
                "the metric is not positive definite: its smallest eigenvalue is "
                f"{values[0]:.3g}, its largest {values[-1]:.3g}"
            )
        matrix.setflags(write=False)
        return matrix

    @cached_property
    def _factor(self) -> Array:
        """L with W = L Lᵀ, shape (nv, nv)."""
        return np.asarray(np.linalg.cholesky(self.W))

    def placed(self, start: Start) -> Self:
        """Return the metric, checked; see `Metric.placed`."""
        nv, shape = start.state.robot.nv, self.W.shape
        with within("matrix"):
            if shape[0] != nv:
                raise MetricError(
                    f"the metric has shape {shape}; the robot needs ({nv}, {nv})"
                )
        return self

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Write the constant W and L once, and return an empty step plan."""
        self.evaluate(state, out)
        return StepPlan()

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W and L; W' stays zero. See `Metric.evaluate`."""
        out.W[:] = self.W
        out.L[:] = self._factor
        return out


class IdentityMetric(Metric, type="identity"):
    """W = I: the motions of all joints count the same. The default."""

    form: ClassVar[int] = IDENTITY

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Return an empty step plan: ``out`` is the identity already."""
        return StepPlan()

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Return ``out`` unchanged: `MetricSample.allocate` returns the identity."""
        return out


_Row = Annotated[list[Number], Field(min_length=1)]


def _array(value: list[Any]) -> Array:
    """Return the matrix or its diagonal, read-only."""
    if len({isinstance(entry, list) for entry in value}) > 1:
        raise ValueError("mixes numbers and rows; needs rows, or numbers (a diagonal)")
    return read_only(value)


_Entries = Annotated[list[Number | _Row], Field(min_length=1)]


class ConstantMetric(FixedMetric, type="constant"):
    """W = const, symmetric positive definite: weighted joints."""

    matrix: Annotated[ArrayLike, ArrayField(_Entries, _array)]
    """W, shape (nv, nv), or its diagonal, shape (nv,) [-]."""

    def __post_init__(self) -> None:
        """Check the matrix."""
        self.W  # noqa: B018 (computed, checked and kept)

    def _matrix(self) -> Array:
        matrix = np.array(self.matrix)
        return np.diag(matrix) if matrix.ndim == 1 else matrix


class CoordinatesMetric(FixedMetric, type="coordinates"):
    """W = AᵀA, Euclidean in the joint coordinates θ = A q.

    The law then equals the paper's law in these coordinates, because a pseudo-inverse
    changes with the coordinates (docs/law.md).
    """

    matrix: Matrix | None = None
    """A, invertible, shape (nv, nv) [-]; as the robot's source defines it by
    default."""

    def __post_init__(self) -> None:
        """Check the matrix."""
        if self.matrix is not None:
            self.W  # noqa: B018 (computed, checked and kept)

    def placed(self, start: Start) -> Self:
        """Return the metric with A as a matrix, checked; see `Metric.placed`."""
        if self.matrix is not None:
            return super().placed(start)
        A = start.state.robot.joint_coordinates
        if A is None:
            raise MetricError(
                f"{start.state.robot.name} defines no joint coordinates; give matrix"
            )
        return replace(self, matrix=A)

    def _matrix(self) -> Array:
        if self.matrix is None:
            raise MetricError("the robot knows these coordinates: place the metric")
        A = np.asarray(self.matrix)
        if A.shape[0] != A.shape[1]:
            raise MetricError(f"the coordinates have shape {A.shape}; need (nv, nv)")
        return np.asarray(A.T @ A)
