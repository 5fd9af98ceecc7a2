"""A plain Cartesian impedance (JᵀK), for comparison: a spring and a damper at the hand.

    tau = Jᵀ (K e + D e') + (1 - Jᵀ J̄ᵀ) M K_N (g - v) + N,      J̄ = M⁻¹Jᵀ(J M⁻¹Jᵀ)⁻¹
    K = Λ₀ Kp,    D = Λ₀ Kv,    Λ₀ = (J M⁻¹Jᵀ)⁻¹ at its first step

So where it begins a small error has the same equation as with the controller's gains.
Elsewhere the stiffness is constant, and the inertia is not: the hand's dynamics vary
with the posture. It has no feed-forward x_d'', so that on a moving target an error of
about Kp⁻¹ x_d'' is left, and no term for J'v.
"""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.interface import ActiveStack
from hsp_control.robot import RobotState
from hsp_control.tasks.feedback import Feedback

_ROUNDING = 1e-6
"""A direction whose mobility is below this part of the largest has no force."""


class PlainImpedance:
    """The law of a spring and a damper with constant matrices."""

    def __init__(self) -> None:
        """Begin without an inertia: the first step determines it."""
        self._inertia = dict[tuple[str, ...], Array]()  # Λ₀ by set of tasks

    def __call__(self, state: RobotState, active: ActiveStack) -> Array:
        """Return M⁻¹ (tau - N), shape (nv,)."""
        J, problem = active.rows.jacobian, active.law.problem
        M_inv_Jt = np.linalg.solve(state.mass_matrix, J.T)
        inertia = np.linalg.pinv(J @ M_inv_Jt, rcond=_ROUNDING, hermitian=True)
        known = self._inertia.setdefault(tuple(active.task_rows), inertia)
        force = known @ feedback_of(state, active)
        towards = problem.gain @ (problem.field.g - state.v)
        return np.asarray(towards + M_inv_Jt @ (force - inertia @ (J @ towards)))


def feedback_of(state: RobotState, active: ActiveStack) -> Array:
    """Return Kp e + Kv e' along the rows of J, shape (m,).

    It is the part of a_x that gains of zero do not have.
    """
    found = active.rows.acceleration.copy()
    for each in active.stacked:
        zero = Feedback(*(np.zeros_like(array) for array in each.in_force.feedback))
        found[each.rows] -= each.planned.task.evaluate(state, None, zero).acceleration
    return found
