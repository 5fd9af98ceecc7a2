"""A smooth transition from holding still to the law."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.control.compensation.checks import check_fixed_base, positive
from hsp_control.robot import Robot, RobotState
from hsp_control.trajectories.schedule import Schedule


class StartUpRamp:
    """Blends the acceleration from that of holding still into the law's.

    a = (1 - s) a_hold + s a_law with a_hold = -2 ω v + ω² (q_0 ⊖ q) and s from 0 to 1,
    twice continuously differentiable. At first the effort compensates gravity and acts
    as a spring to the first configuration q_0. The limits hold for the blend.

    Attributes:
        duration: Time until s = 1 [s].
        natural_frequency: ω of the spring [rad/s]; 0: gravity compensation only.
    """

    def __init__(self, duration: float, natural_frequency: float = 0.0) -> None:
        """Set the ramp; see the attributes.

        Raises:
            CompensationError: If the duration is not positive, or the frequency is
                negative.
        """
        self.duration = positive(duration, "duration")
        if not 0.0 <= natural_frequency < np.inf:
            raise CompensationError(
                f"natural_frequency is {natural_frequency}; must not be negative"
            )
        self.natural_frequency = float(natural_frequency)

    def check(self, robot: Robot) -> None:
        """Check that the motors alone can hold the robot still.

        Raises:
            CompensationError: If the robot has a free-flyer root.
        """
        check_fixed_base(robot, "start_up_ramp")

    def restart(self) -> None:
        """Start the ramp anew, at the next state passed to `begin`."""
        self._schedule: Schedule | None = None

    def begin(self, state: RobotState) -> None:
        """Store the first state; later states have no effect."""
        if self._schedule is None:
            self._schedule = Schedule([(state.t, None)], ramp=self.duration)
            self._q0 = state.q.copy()

    def weight(self, t: float) -> float:
        """Return the weight s of the law at time t [s]."""
        return 0.0 if self._schedule is None else self._schedule.weight(t)

    def blend(self, state: RobotState, a: Array) -> Array:
        """Return the blend with the law's acceleration a, shape (nv,)."""
        s = self.weight(state.t)
        if s >= 1.0:
            return a
        w = self.natural_frequency
        away = state.robot.difference(state.q, self._q0)
        return np.asarray((1.0 - s) * (w * w * away - 2.0 * w * state.v) + s * a)
