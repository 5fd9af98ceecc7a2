"""Rows for the base motions that neither a motor nor a contact can drive."""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.law import TaskSample
from hsp_control.robot import Robot, RobotState


class UnactuatedRows:
    """The rows Uᵀ(M a + N) = 0, with U the base motions that all contacts permit.

    Contacts may leave some base motions free (two point feet: the rotation about the
    line between them; in the air: all six). Nothing can produce an effort along such a
    motion, so the law must not require one. The rows UᵀM are divided by the robot's
    mass, which makes them comparable with those of tasks.
    """

    def __init__(self, robot: Robot, base: Indices, count: int) -> None:
        """Create the rows."""
        self.name = "unactuated"  # name of these rows in messages
        self.robot = robot
        self.rows = count  # the number of free base motions
        self._base = base
        self._mass = sum(inertia.mass for inertia in robot.model.inertias)

    def evaluate(
        self, state: RobotState, contacts: TaskSample, out: TaskSample
    ) -> TaskSample:
        """Write the rows, given the stacked rows of the contacts."""
        A = contacts.jacobian[:, self._base]
        A_dot = contacts.jacobian_dot[:, self._base]
        U = np.eye(len(self._base))
        if len(A):
            U = np.linalg.svd(A)[2][len(self._base) - self.rows :].T
        # A U = 0 at all times, so U' = -A⁺A'U, up to a change of basis of the rows.
        U_dot = -np.linalg.pinv(A) @ A_dot @ U if len(A) else np.zeros_like(U)
        M, M_dot = state.mass_matrix[self._base], state.mass_matrix_rate[self._base]
        out.jacobian[:] = U.T @ M / self._mass
        out.jacobian_dot[:] = (U.T @ M_dot + U_dot.T @ M) / self._mass
        effects = U.T @ state.nonlinear_effects[self._base] / self._mass
        out.acceleration[:] = out.jacobian_dot @ state.v - effects
        return out


def unactuated_count(jacobian: Array, base: Indices) -> int:
    """Return how many base motions the contacts' stacked rows (m, nv) permit."""
    if not len(jacobian):
        return len(base)
    values = np.linalg.svd(jacobian[:, base], compute_uv=False)
    return len(base) - int((values > 1e-6 * max(1.0, float(values[0]))).sum())
