"""The kinetic-energy metric, of Khatib's dynamically consistent inverse."""

from dataclasses import KW_ONLY, replace
from typing import ClassVar, Literal, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import MetricError
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import cholesky
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.declaration.quantities import Positive
from hsp_control.geometry.start import Start
from hsp_control.law import VARYING, MetricSample
from hsp_control.null_space.metrics.metric import Metric
from hsp_control.robot import RobotState


class MassMatrixMetric(Metric, type="mass_matrix"):
    """W = M(q)/m, W' = (C + Cᵀ)/m: the kinetic energy is ½ m vᵀWv.

    Null-space efforts do not accelerate the task (dynamically consistent). M is badly
    conditioned on real robots (condition number 4e2 on a Panda, 1e5 on a humanoid):
    light joints, such as wrists, then do most of the task's motion.
    """

    _: KW_ONLY
    inertia: Positive | Literal["robot"] = 1.0
    """m [kg·m²]: J# and the projector are the same whatever it is; joints of this
    inertia descend a cost as fast as with the identity, lighter ones faster. ``robot``:
    the geometric mean of its joints'."""

    form: ClassVar[int] = VARYING

    def placed(self, start: Start) -> Self:
        """Return the metric with the robot's own inertia in numbers."""
        if self.inertia != "robot":
            return self
        return replace(self, inertia=start.state.robot.typical_inertia)

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Return the step plan; where M is singular it writes NaN: the law tells."""
        if state.robot.mimics:
            return super().compile(state, out)
        matrices = state.mass_matrix, state.coriolis_matrix
        update = state.compute_mass_matrix, state.compute_coriolis_matrix
        unit = self._unit(state)
        return StepPlan((), (*update, bind(_write, *matrices, unit, *out)))

    def _unit(self, state: RobotState) -> float:
        robot = state.robot
        return robot.typical_inertia if self.inertia == "robot" else self.inertia

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W = M/m, L and W' = M'/m; see `Metric.evaluate`."""
        unit = self._unit(state)
        out.W[:] = state.mass_matrix / unit
        if not cholesky(out.W, out.L):
            raise MetricError(f"the mass matrix is singular at q = {state.q.tolist()}")
        out.W_dot[:] = state.mass_matrix_rate / unit
        return out


@kernel
def _write(M: Array, C: Array, unit: float, W: Array, L: Array, W_dot: Array) -> None:
    """Write W = M/m, its factor L and W' = (C + Cᵀ)/m; L is NaN if M is singular."""
    n = M.shape[0]
    for i in range(n):
        for j in range(n):
            W[i, j] = M[i, j] / unit
            W_dot[i, j] = (C[i, j] + C[j, i]) / unit
    if not cholesky(W, L):
        L[0, 0] = np.nan
