"""The state between measurements: the last one, integrated with the model."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError
from hsp_control.engine import Dynamics
from hsp_control.robot import Robot, RobotState


class DeadReckoning:
    """The last measured state, integrated with the model under the applied efforts.

    For a robot with a floating base the velocity is kept: the forces at its feet are
    unknown meanwhile, and without them the model would fall.
    """

    def __init__(
        self, robot: Robot, period: float, dynamics: Dynamics | None = None
    ) -> None:
        self._robot, self._period = robot, period
        self.state = RobotState(robot, dynamics)  # the state, measured or predicted
        self.predicted_for = 0.0  # time since the last measurement [s]

    def correct(self, t: float, q: Array, v: Array) -> None:
        """Set the state to a measurement."""
        self.state.update(t, q, v)
        self.predicted_for = 0.0

    def predict(self, tau: Array) -> None:
        """Integrate the state over one period under an effort, shape (nv,)."""
        state, h = self.state, self._period
        self.predicted_for += h
        v = state.v.copy()
        if not self._robot.unactuated:
            v += h * self._robot.forward_dynamics(state.q, state.v, tau, state.dynamics)
        if not np.isfinite(v).all():
            return
        try:
            state.update(state.t + h, self._robot.integrate(state.q, h * v), v)
        except HspControlError:  # too fast: the configuration would overflow
            return
