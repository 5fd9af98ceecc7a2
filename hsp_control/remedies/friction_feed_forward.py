"""Friction, paid for before it is felt."""

from typing import Any

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import RemedyError, SimulationError
from hsp_control.mode import Mode
from hsp_control.plants import JointFriction
from hsp_control.remedies.checks import positive
from hsp_control.robot import Robot, RobotState


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
            RemedyError: If the smoothing is not positive.
        """
        self.coulomb = coulomb
        self.viscous = viscous
        self.smoothing = positive(smoothing, "smoothing")

    def check(self, robot: Robot) -> None:
        """Refuse what does not fit the robot.

        Raises:
            RemedyError: If a number is negative, or their count is not nv.
        """
        self._friction(robot)

    def restart(self, robot: Robot) -> None:
        """Take the robot's joints."""
        self._own = self._friction(robot)

    def effort(self, state: RobotState, mode: Mode) -> Array:
        """Return the effort, shape (nv,), after the law was resolved at a state."""
        v = wanted_velocity(state, mode)
        own = self._own
        dry = own.coulomb * np.tanh(v / self.smoothing)
        return np.asarray(dry + own.viscous * v)

    def _friction(self, robot: Robot) -> JointFriction:
        try:
            return JointFriction.of(robot, self.coulomb, self.viscous)
        except SimulationError as error:
            raise RemedyError(f"friction_feed_forward: {error}") from None


def wanted_velocity(state: RobotState, mode: Mode) -> Array:
    """Return v_d = J# x_d' + P g = v + e_N + J#(x_d' - J v), shape (nv,).

    Near a singularity J# is bounded as the law's own is, by its threshold. Rows of a
    floating base that nothing pushes ask for nothing.
    """
    resolution, v = mode.resolution, state.v
    problem = resolution.problem
    J = problem.task.jacobian
    missing = -J @ v
    missing[sum(contact.rows for contact in mode.contacts) : mode.first_task_row] = 0.0
    for level in mode.levels:
        for task in level:
            missing[mode.task_rows[task.name]] += task.reference_rate(state)
    B = np.linalg.solve(problem.metric.W, J.T)
    values, U = np.linalg.eigh(J @ B)
    least = resolution.threshold**2
    # 1/s, and its continuation of bounded slope below the threshold (law.md §4).
    inverse = np.where(
        values >= least,
        1.0 / np.maximum(values, least),
        (2.0 - values / least) / least,
    )
    wanted = v + resolution.null_space_error + B @ (U @ (inverse * (U.T @ missing)))
    return np.asarray(wanted)
