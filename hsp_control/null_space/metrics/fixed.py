"""The base class of constant metrics."""

from abc import abstractmethod
from functools import cached_property
from typing import ClassVar, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import MetricError
from hsp_control.common.step_plan import StepPlan
from hsp_control.declaration import within
from hsp_control.geometry.start import Start
from hsp_control.law import CONSTANT, MetricSample
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
        """The matrix, read-only, shape (nv, nv).

        Raises:
            MetricError: If it is not finite, square, symmetric and positive definite.
        """
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
