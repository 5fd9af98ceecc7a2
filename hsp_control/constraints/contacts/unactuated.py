"""Rows for the freedoms that neither a motor nor a contact can push."""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import TaskSample


class UnactuatedRows:
    """Uᵀ(M a + N) = 0, with U the base motions that every contact permits.

    Where contacts leave the base a motion of its own (two point feet: a turn about the
    line between them; in the air: all six), nothing produces an effort along it, and
    the law must ask for none. The rows UᵀM are divided by the robot's mass, which makes
    them comparable with those of tasks.

    Attributes:
        name: What messages call it.
        rows: How many such motions there are.
    """

    def __init__(self, robot: Robot, base: Indices, count: int) -> None:
        """Set how many base motions the contacts permit, of the freedoms ``base``."""
        self.name = "unactuated"
        self.robot = robot
        self.rows = count
        self._base = base
        self._mass = sum(inertia.mass for inertia in robot.model.inertias)

    def evaluate(
        self, state: RobotState, contacts: TaskSample, out: TaskSample
    ) -> TaskSample:
        """Write the rows, given those of the contacts, stacked."""
        A = contacts.jacobian[:, self._base]
        A_dot = contacts.jacobian_dot[:, self._base]
        U = np.eye(len(self._base))
        if len(A):
            U = np.linalg.svd(A)[2][len(self._base) - self.rows :].T
        # A U = 0 at all times: U' = -A⁺A'U, up to what only mixes the rows.
        U_dot = -np.linalg.pinv(A) @ A_dot @ U if len(A) else np.zeros_like(U)
        M, M_dot = state.mass_matrix[self._base], state.mass_matrix_rate[self._base]
        out.jacobian[:] = U.T @ M / self._mass
        out.jacobian_dot[:] = (U.T @ M_dot + U_dot.T @ M) / self._mass
        effects = U.T @ state.nonlinear_effects[self._base] / self._mass
        out.acceleration[:] = out.jacobian_dot @ state.v - effects
        return out


def unactuated_count(jacobian: Array, base: Indices) -> int:
    """Return how many base motions the contacts' rows permit."""
    if not len(jacobian):
        return len(base)
    values = np.linalg.svd(jacobian[:, base], compute_uv=False)
    return len(base) - int((values > 1e-6 * max(1.0, float(values[0]))).sum())
