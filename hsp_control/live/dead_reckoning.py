"""Where a robot that is not seen must be by now, if the model is right."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError
from hsp_control.robot import Robot, RobotState


class DeadReckoning:
    """The last state that was seen, carried on by the model under the efforts sent.

    Attributes:
        state: The state, seen or reckoned.
        blind: For how long it has not been seen [s].
    """

    def __init__(self, robot: Robot, period: float) -> None:
        """Allocate."""
        self._robot, self._period = robot, period
        self.state = RobotState(robot)
        self.blind = 0.0

    def see(self, t: float, q: Array, v: Array) -> None:
        """Take a state that was measured, at time t [s]."""
        self.state.update(t, q, v)
        self.blind = 0.0

    def reckon(self, tau: Array) -> None:
        """Carry the state on for a period under an effort, shape (nv,).

        One semi-implicit Euler step. Where the model's answer is no state, it stays.
        """
        state, h = self.state, self._period
        self.blind += h
        a = self._robot.forward_dynamics(state.q, state.v, tau)
        v = state.v + h * a
        if not np.isfinite(v).all():
            return
        try:
            state.update(state.t + h, self._robot.integrate(state.q, h * v), v)
        except HspControlError:  # a speed beyond all bounds: no configuration
            return
