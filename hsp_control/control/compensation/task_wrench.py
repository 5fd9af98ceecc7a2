"""The force at a task that explains the efforts that an observer has estimated."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.linalg import cholesky
from hsp_control.law import VARYING
from hsp_control.law.pseudo_inverse import (
    apply_pseudo_inverse_transpose,
    weighted_pseudo_inverse,
)
from hsp_control.robot import RobotState
from hsp_control.tasks import Task


def task_wrench(
    task: Task, state: RobotState, disturbance: Array, threshold: float
) -> Array:
    """Return f = Λ J M⁻¹ r = J̄ᵀ r, shape (m,): the force at the rows of a task.

    If r = Jᵀf then this is f. Whatever else r is, f is the force that moves the task as
    r does. J̄ = M⁻¹JᵀΛ is bounded near singularities as the law's own pseudo-inverse is:
    a force along a lost direction, which the joints do not feel, is taken for zero.
    """
    J = task.evaluate(state, feedback=task.feedback()).jacobian
    m, nv = J.shape
    L, B, Q = np.zeros((nv, nv)), np.zeros((m, nv)), np.zeros((m, nv))
    X, part, force = np.zeros((m, m)), np.zeros(m), np.zeros(m)
    if not cholesky(state.mass_matrix, L):
        return np.full(m, np.nan)
    weighted_pseudo_inverse(J, L, VARYING, threshold, B, Q, X)
    apply_pseudo_inverse_transpose(Q, X, L, VARYING, disturbance.copy(), part, force)
    return force
