"""The operational-space law, for comparison: the one of most other controllers.

    a = J# (a_x - J'v) + (I - J# J) K_N (g - v),    J# = W⁻¹Jᵀ(J W⁻¹Jᵀ)⁻¹

With W = M it is Khatib's (1987); here W is the metric of the controller, so that both
laws have the same projector, tasks, field and gains. The tasks obey the same equation.
The law lacks the motion of the null space: with P = I - J# J, nothing cancels P' and
g', so that the null-space velocity follows a moving field only with an error, which no
theorem bounds.
"""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.interface import (
    ActiveStack,
    CompensatedController,
    ControlOutput,
)
from hsp_control.robot import RobotState


class ComparedController(CompensatedController):
    """A controller that can follow the operational-space law instead."""

    operational = False

    def _law(self, t: float, q: Array, v: Array) -> ControlOutput:
        if not self.operational:
            return super()._law(t, q, v)
        return self.controller.compute(t, q, v, modifier=self._compared)

    def _compared(
        self, state: RobotState, active: ActiveStack, a: Array
    ) -> tuple[Array, Array | None]:
        return self._modify(state, active, operational_space(state, active))


def operational_space(state: RobotState, active: ActiveStack) -> Array:
    """Return the law's acceleration, (nv,), all priorities alike, without damping."""
    J, J_dot = active.rows.jacobian, active.rows.jacobian_dot
    problem = active.law.problem
    W_inv_Jt = np.linalg.solve(problem.metric.W, J.T)
    inverse = W_inv_Jt @ np.linalg.pinv(J @ W_inv_Jt, rcond=1e-9)
    wanted = active.rows.acceleration - J_dot @ state.v
    towards = problem.gain @ (problem.field.g - state.v)
    return np.asarray(towards + inverse @ (wanted - J @ towards))
