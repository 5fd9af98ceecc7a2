"""The kinetic-energy metric, of Khatib's dynamically consistent inverse."""

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


class MassMatrixMetric(Metric, type="mass_matrix"):
    """W = M(q), W' = C + Cᵀ: the kinetic energy is ½ vᵀWv.

    Null-space efforts do not accelerate the task (dynamically consistent). M is badly
    conditioned on real robots (condition number 4e2 on a Panda, 1e5 on a humanoid):
    light joints, such as wrists, then do most of the task's motion.
    """

    form: ClassVar[int] = VARYING

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Return the step plan that does what `evaluate` does; see `Metric.compile`.

        Where M is singular it writes NaN into L, so that the law reports that the step
        is not finite.
        """
        if state.robot.mimics:
            return super().compile(state, out)
        matrices = state.mass_matrix, state.coriolis_matrix
        update = state.compute_mass_matrix, state.compute_coriolis_matrix
        return StepPlan((), (*update, bind(_write, *matrices, *out)))

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W = M, L and W' = M'; see `Metric.evaluate`.

        Raises:
            MetricError: If M is singular.
        """
        out.W[:] = state.mass_matrix
        if not cholesky(out.W, out.L):
            raise MetricError(f"the mass matrix is singular at q = {state.q.tolist()}")
        out.W_dot[:] = state.mass_matrix_rate
        return out


@kernel
def _write(M: Array, C: Array, W: Array, L: Array, W_dot: Array) -> None:
    """Write W = M, its factor L and W' = C + Cᵀ; L is NaN if M is singular."""
    n = M.shape[0]
    for i in range(n):
        for j in range(n):
            W[i, j] = M[i, j]
            W_dot[i, j] = C[i, j] + C[j, i]
    if not cholesky(W, L):
        L[0, 0] = np.nan
