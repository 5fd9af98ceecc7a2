"""A constant metric: weighted joints, or the paper's law in coordinates theta = A q."""

from typing import Any, ClassVar, Self

import numpy as np

from hsp_control.common.exceptions import MetricError
from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.metrics.metric import CONSTANT, Metric, MetricSample
from hsp_control.robot import RobotState


class ConstantMetric(Metric):
    """W constant, symmetric positive definite.

    With W = AᵀA the law is the paper's in the coordinates theta = A q, since a
    pseudo-inverse is not invariant under a change of coordinates (law.md §2).
    """

    form: ClassVar[int] = CONSTANT

    def __init__(self, W: Any) -> None:
        """Set the metric.

        Args:
            W: A matrix of shape (nv, nv), or its diagonal, shape (nv,).

        Raises:
            MetricError: If W is not square, symmetric and positive definite.
        """
        matrix = np.asarray(W, dtype=float)
        if matrix.ndim == 1:
            matrix = np.diag(matrix)
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1] or not matrix.size:
            raise MetricError(f"metric has shape {matrix.shape}; needs (nv, nv)")
        if not np.isfinite(matrix).all():
            raise MetricError("metric holds a NaN or an infinity")
        if np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max():
            raise MetricError("metric is not symmetric")
        values = np.linalg.eigvalsh(matrix)
        if values[0] <= 1e-12 * values[-1]:  # rounding lifts a 0 to about 1e-16
            raise MetricError(
                "metric is not positive definite: its least eigenvalue is "
                f"{values[0]:.3g}, its largest {values[-1]:.3g}"
            )
        self.W = matrix.copy()
        self._factor = np.linalg.cholesky(matrix)

    @classmethod
    def from_coordinates(cls, A: Any) -> Self:
        """Return W = AᵀA, Euclidean in the coordinates theta = A q.

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
        """Raise MetricError if W is not of the robot's size."""
        if self.W.shape[0] != nv:
            raise MetricError(
                f"metric has shape {self.W.shape}; the robot needs ({nv}, {nv})"
            )

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Write W and its factor, which stay, and return nothing to do."""
        self.evaluate(state, out)
        return StepPlan()

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W and its factor; W' stays zero."""
        out.W[:] = self.W
        out.L[:] = self._factor
        return out
