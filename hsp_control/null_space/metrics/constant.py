"""A constant metric: weighted joints, or the paper's law in coordinates θ = A q."""

from typing import Any, ClassVar, Self

import numpy as np

from hsp_control.common.exceptions import MetricError
from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.metrics.metric import CONSTANT, Metric, MetricSample
from hsp_control.robot import RobotState


class ConstantMetric(Metric):
    """W = const, symmetric positive definite.

    With W = AᵀA the law equals the paper's law in the coordinates θ = A q, because a
    pseudo-inverse changes with the coordinates (docs/law.md).

    Attributes:
        W: The matrix, shape (nv, nv).
    """

    form: ClassVar[int] = CONSTANT

    def __init__(self, W: Any) -> None:
        """Set the metric.

        Args:
            W: A matrix of shape (nv, nv), or its diagonal, shape (nv,).

        Raises:
            MetricError: If W is not finite, square, symmetric and positive definite.
        """
        matrix = np.asarray(W, dtype=float)
        if matrix.ndim == 1:
            matrix = np.diag(matrix)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
            raise MetricError(f"metric has shape {matrix.shape}; needs (nv, nv)")
        if not np.isfinite(matrix).all():
            raise MetricError("metric contains NaN or inf")
        if np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max():
            raise MetricError("metric is not symmetric")
        values = np.linalg.eigvalsh(matrix)
        if values[0] <= 1e-12 * values[-1]:  # a zero may be computed as about 1e-16
            raise MetricError(
                "metric is not positive definite: its smallest eigenvalue is "
                f"{values[0]:.3g}, its largest {values[-1]:.3g}"
            )
        self.W = matrix.copy()
        self._factor = np.linalg.cholesky(matrix)

    @classmethod
    def from_coordinates(cls, A: Any) -> Self:
        """Return the metric W = AᵀA, Euclidean in the coordinates θ = A q.

        Args:
            A: An invertible matrix of shape (nv, nv).

        Raises:
            MetricError: If A is not square and invertible.
        """
        matrix = np.asarray(A, dtype=float)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
            raise MetricError(f"coordinates A have shape {matrix.shape}; need (nv, nv)")
        return cls(matrix.T @ matrix)

    def check(self, nv: int) -> None:
        """Check that W has shape (nv, nv).

        Raises:
            MetricError: If it has another shape.
        """
        if self.W.shape[0] != nv:
            raise MetricError(
                f"metric has shape {self.W.shape}; the robot needs ({nv}, {nv})"
            )

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Write the constant W and L once, and return an empty step plan."""
        self.evaluate(state, out)
        return StepPlan()

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W and L; W' stays zero. See `Metric.evaluate`."""
        out.W[:] = self.W
        out.L[:] = self._factor
        return out
