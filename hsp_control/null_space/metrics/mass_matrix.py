"""The kinetic-energy metric: Khatib's dynamically consistent inverse."""

from functools import partial
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import MetricError
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import cholesky
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.metrics.metric import VARYING, Metric, MetricSample
from hsp_control.robot import RobotState


class MassMatrixMetric(Metric):
    """W = M(q), W' = C + Cᵀ: null-space motion that does no work on the task.

    M is badly conditioned on real robots (4e2 on a Panda, 1e5 on a humanoid): the
    light wrists then do the task's work (theory.md §3).
    """

    form: ClassVar[int] = VARYING

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Return what `evaluate` does with this state and this sample.

        Where M is singular L is NaN, so that the step is refused.
        """
        if state.robot.mimics:
            return super().compile(state, out)
        matrices = state.mass_matrix, state.coriolis_matrix
        bring = [
            partial(getattr, state, name) for name in ("mass_matrix", "coriolis_matrix")
        ]
        return StepPlan((), (*bring, bind(_write, *matrices, *out)))

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write M, its factor and its rate."""
        out.W[:] = state.mass_matrix
        if not cholesky(out.W, out.L):
            raise MetricError(f"the mass matrix is singular at q = {state.q.tolist()}")
        out.W_dot[:] = state.mass_matrix_rate
        return out


@kernel
def _write(M: Array, C: Array, W: Array, L: Array, W_dot: Array) -> None:
    """Write W = M, its factor and W' = C + Cᵀ."""
    n = M.shape[0]
    for i in range(n):
        for j in range(n):
            W[i, j] = M[i, j]
            W_dot[i, j] = C[i, j] + C[j, i]
    if not cholesky(W, L):
        L[0, 0] = np.nan
