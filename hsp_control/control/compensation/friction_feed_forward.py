"""Feed-forward of joint friction."""

from collections.abc import Mapping
from typing import Any, Literal, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import CompensationError, SimulationError
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.compensation.stage import Run, Stage
from hsp_control.control.measurement import LogChannel
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import Positive, Weights
from hsp_control.law import VARYING
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.friction import JointFriction


class FrictionFeedForward(Part, error=CompensationError):
    """Adds the friction effort at the desired velocity.

    The desired velocity is v_d = J# x_d' + P g, the velocity of the robot once both
    errors of the law are zero. Measurement noise cancels in it, and a sticking joint is
    pushed in the desired direction. The Coulomb part is smoothed near zero velocity:

        tau = c tanh(v_d / v_s) + D v_d

    Coefficients that are too small are better than ones that are too large.
    """

    coulomb: Weights = 0.0
    """Coulomb friction c [N·m or N], one number or nv."""
    viscous: Weights = 0.0
    """Viscous friction D [N·m·s/rad or N·s/m], one number or nv."""
    smoothing: Positive = 0.02
    """Speed v_s at which three quarters of the Coulomb friction are compensated [rad/s
    or m/s]."""

    @classmethod
    def of_model(cls, robot: Robot) -> Self:
        """Return the feed-forward of the friction in the robot's URDF."""
        own = JointFriction.of_model(robot)
        return cls(own.coulomb, own.viscous)

    def check(self, robot: Robot) -> None:
        """Check that the coefficients fit the robot."""
        self._friction(robot)

    def effort(self, state: RobotState, active: ActiveStack) -> Array:
        """Return the friction effort, shape (nv,) [N·m or N]."""
        v = desired_velocity(state, active)
        friction = state.cached(self, "friction", lambda: self._friction(state.robot))
        coulomb = friction.coulomb * np.tanh(v / self.smoothing)
        return np.asarray(coulomb + friction.viscous * v)

    def _friction(self, robot: Robot) -> JointFriction:
        """Return the coefficients of the degrees of freedom."""
        try:
            return JointFriction.of(robot, self.coulomb, self.viscous)
        except SimulationError as error:
            with within(*error.path):
                raise CompensationError(error.bare_message) from None


class RunningFriction(Stage):
    """A friction feed-forward in one run."""

    def __init__(
        self, declared: FrictionFeedForward | Literal["urdf"], robot: Robot
    ) -> None:
        own = FrictionFeedForward.of_model(robot) if declared == "urdf" else declared
        self._declared: Any = own

    def act(self, run: Run, state: RobotState, active: ActiveStack) -> None:
        """Add the friction; see `Stage.act`."""
        own = self._declared.effort(state, active)
        run.friction = run.friction + active.share * own
        run.effort = run.effort + own

    def log_channels(self, run: Run) -> Mapping[str, LogChannel]:
        """Return the added effort; see `Stage.log_channels`."""
        sent = LogChannel(run.friction_sent, "N·m or N", "feed-forward of friction")
        return {"friction.feed_forward": sent}


def desired_velocity(state: RobotState, active: ActiveStack) -> Array:
    """Return v_d = J# x_d' + P g = v + e_N + J#(x_d' - J v), shape (nv,)."""
    # J# is that of the law, bounded near singularities by the law's threshold. The rows
    # of unactuated base motions have no desired rate.
    law, v, state = active.law, state.v, state.read_only
    task, metric = law.problem.task, law.problem.metric
    rate_error = -task.jacobian @ v
    contact_rows = sum(contact.rows for contact in active.contacts)
    rate_error[contact_rows : active.first_task_row] = 0.0
    for each in active.stacked:
        rate_error[each.rows] += each.planned.task.reference_rate(state)
    m, n = task.jacobian.shape
    if m > n:  # conflicting levels: least squares over all of them
        B = np.linalg.solve(metric.L, task.jacobian.T)
        minimal = np.linalg.pinv(B.T, rcond=law.threshold) @ rate_error
        raised = np.linalg.solve(metric.L.T, minimal)
        return np.asarray(v + law.null_space_error + raised)
    motion = np.zeros(n)
    engine.SmallestMotion(
        J=task.jacobian,
        L=metric.L,
        form=VARYING,
        threshold=law.threshold,
        x=rate_error,
        motion=motion,
    )()
    return np.asarray(v + law.null_space_error + motion)
