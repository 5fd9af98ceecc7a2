"""Friction, paid for before it is felt."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError, SimulationError
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.compensation.checks import positive
from hsp_control.law.pseudo_inverse import apply_pseudo_inverse, weighted_pseudo_inverse
from hsp_control.null_space.metrics.metric import VARYING
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.friction import JointFriction


class FrictionFeedForward:
    """What friction takes at the velocity that the law is after.

    That velocity is v_d = J# x_d' + P g, what the law makes of the robot once both
    errors have died (law.md §2); measured noise cancels in it, and a joint that sticks
    is pushed where it is to go. The dry part is smoothed about rest,

        tau = c tanh(v_d / v_s) + D v_d.

    Attributes:
        coulomb: c, a number or shape (nv,) [N·m or N].
        viscous: D, a number or shape (nv,) [N·m·s/rad or N·s/m].
        smoothing: v_s [rad/s or m/s].
    """

    def __init__(
        self, coulomb: Any = 0.0, viscous: Any = 0.0, smoothing: float = 0.02
    ) -> None:
        """Set what is known of the friction; too little is better than too much.

        Args:
            coulomb: Dry friction, of all joints or of each freedom [N·m or N].
            viscous: Friction for each unit of speed, of all or of each.
            smoothing: Speed at which three quarters of the dry friction are paid for.

        Raises:
            CompensationError: If the smoothing is not positive.
        """
        self.coulomb = coulomb
        self.viscous = viscous
        self.smoothing = positive(smoothing, "smoothing")

    def check(self, robot: Robot) -> None:
        """Refuse what does not fit the robot.

        Raises:
            CompensationError: If a number is negative, or their count is not nv.
        """
        self._friction(robot)

    def restart(self, robot: Robot) -> None:
        """Take the robot's joints."""
        self._own = self._friction(robot)

    def effort(self, state: RobotState, mode: ActiveStack) -> Array:
        """Return the effort, shape (nv,), after the law was resolved at a state."""
        v = wanted_velocity(state, mode)
        own = self._own
        dry = own.coulomb * np.tanh(v / self.smoothing)
        return np.asarray(dry + own.viscous * v)

    def _friction(self, robot: Robot) -> JointFriction:
        try:
            return JointFriction.of(robot, self.coulomb, self.viscous)
        except SimulationError as error:
            raise CompensationError(f"friction_feed_forward: {error}") from None


def wanted_velocity(state: RobotState, mode: ActiveStack) -> Array:
    """Return v_d = J# x_d' + P g = v + e_N + J#(x_d' - J v), shape (nv,).

    J# is the law's own, bounded near singularities by the law's threshold. Rows of a
    floating base that nothing pushes ask for nothing.
    """
    resolution, v = mode.resolution, state.v
    task, metric = resolution.problem.task, resolution.problem.metric
    missing = -task.jacobian @ v
    missing[sum(contact.rows for contact in mode.contacts) : mode.first_task_row] = 0.0
    for level in mode.levels:
        for each in level:
            missing[mode.task_rows[each.name]] += each.reference_rate(state)
    m, n = task.jacobian.shape
    if m > n:  # levels in conflict: the least squares of them all
        B = np.linalg.solve(metric.L, task.jacobian.T)
        least = np.linalg.pinv(B.T, rcond=resolution.threshold) @ missing
        raised = np.linalg.solve(metric.L.T, least)
        return np.asarray(v + resolution.null_space_error + raised)
    B, Q, X = np.zeros((m, n)), np.zeros((m, n)), np.zeros((m, m))
    weighted_pseudo_inverse(
        task.jacobian, metric.L, VARYING, resolution.threshold, B, Q, X
    )
    least = np.zeros(n)
    apply_pseudo_inverse(Q, X, metric.L, VARYING, missing, np.zeros(m), least)
    return np.asarray(v + resolution.null_space_error + least)
