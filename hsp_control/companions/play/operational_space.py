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
from hsp_control.control.interface import ActiveStack
from hsp_control.robot import RobotState


def operational_space(state: RobotState, active: ActiveStack) -> Array:
    """Return the law's acceleration, (nv,), all priorities alike, without damping."""
    J, J_dot = active.rows.jacobian, active.rows.jacobian_dot
    problem = active.law.problem
    W_inv_Jt = np.linalg.solve(problem.metric.W, J.T)
    inverse = W_inv_Jt @ np.linalg.pinv(J @ W_inv_Jt, rcond=1e-9)
    desired = active.rows.acceleration - J_dot @ state.v
    towards = problem.gain @ (problem.field.g - state.v)
    return np.asarray(towards + inverse @ (desired - J @ towards))
