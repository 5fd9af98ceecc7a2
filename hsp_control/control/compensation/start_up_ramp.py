"""A smooth transition from holding still to the law."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import NonNegative, Positive
from hsp_control.robot import RobotState
from hsp_control.trajectories.schedule import Schedule


class StartUpRamp(Part, error=CompensationError):
    """The effort changes smoothly from holding still to the law.

    a = (1 - s) a_hold + s a_law with a_hold = -2 ω v + ω² (q_0 ⊖ q) and s from 0 to 1,
    twice continuously differentiable. At first the effort compensates gravity and acts
    as a spring to the first configuration q_0. The limits hold for the blend.
    """

    duration: Positive = 1.0
    """Time until the law is fully active, s = 1 [s]."""
    natural_frequency: NonNegative = 0.0
    """Natural frequency ω of the spring that holds the robot meanwhile [rad/s]; 0 is
    pure gravity compensation."""


class RunningRamp:
    """A start-up ramp in one run: it knows when and where it began."""

    def __init__(self, declared: StartUpRamp, state: RobotState) -> None:
        self._frequency = declared.natural_frequency
        self._schedule = Schedule([(state.t, None)], ramp=declared.duration)
        self._q0 = state.q.copy()

    def weight(self, t: float) -> float:
        """Return the weight s of the law at time t [s]."""
        return self._schedule.weight(t)

    def blend(self, state: RobotState, a: Array) -> Array:
        """Return the blend with the law's acceleration a, shape (nv,)."""
        s = self.weight(state.t)
        if s >= 1.0:
            return a
        w = self._frequency
        away = state.robot.difference(state.q, self._q0)
        return np.asarray((1.0 - s) * (w * w * away - 2.0 * w * state.v) + s * a)
