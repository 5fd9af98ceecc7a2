"""The kinetic-energy metric: Khatib's dynamically consistent inverse."""

from typing import ClassVar

from hsp_control.exceptions import MetricError
from hsp_control.linalg import cholesky
from hsp_control.metrics.metric import VARYING, Metric, MetricSample
from hsp_control.robot import RobotState


class MassMatrixMetric(Metric):
    """W = M(q), W' = C + Cᵀ: null-space motion that does no work on the task.

    M is badly conditioned on real robots (4e2 on a Panda, 1e5 on a humanoid): the
    light wrists then do the task's work (theory.md §3).
    """

    form: ClassVar[int] = VARYING

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write M, its factor and its rate."""
        out.W[:] = state.mass_matrix
        if not cholesky(out.W, out.L):
            raise MetricError(f"the mass matrix is singular at q = {state.q.tolist()}")
        out.W_dot[:] = state.mass_matrix_rate
        return out
