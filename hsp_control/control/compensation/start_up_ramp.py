"""From rest to the law without a jump."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.control.compensation.checks import positive, refuse_floating_base
from hsp_control.robot import Robot, RobotState
from hsp_control.trajectories.schedule import Schedule


class StartUpRamp:
    """The law's acceleration grows from that of holding still to its own.

    a = (1 - s) a_hold + s a_law with s from 0 to 1, twice continuously differentiable,
    a_hold = -2 ω v + ω² (q_0 ⊖ q): at first the effort is that of gravity, and of a
    spring to where the robot was found. Limits are kept by the mixture.

    Attributes:
        duration: Until the law has all [s].
        natural_frequency: ω of the spring [rad/s]; 0 is gravity compensation.
    """

    def __init__(self, duration: float, natural_frequency: float = 0.0) -> None:
        """Set the ramp; see the attributes.

        Raises:
            CompensationError: If duration is not positive or frequency negative.
        """
        self.duration = positive(duration, "duration")
        if not 0.0 <= natural_frequency < np.inf:
            raise CompensationError(
                f"natural_frequency is {natural_frequency}; must not be negative"
            )
        self.natural_frequency = float(natural_frequency)

    def check(self, robot: Robot) -> None:
        """Refuse a robot that does not hold still by its motors alone.

        Raises:
            CompensationError: If it has a free-flyer root.
        """
        refuse_floating_base(robot, "start_up_ramp")

    def restart(self) -> None:
        """Begin with the first state that is shown."""
        self._schedule: Schedule | None = None

    def begin(self, state: RobotState) -> None:
        """Take the state that the robot is found in, if it is the first."""
        if self._schedule is None:
            self._schedule = Schedule([(state.t, np.inf)], ramp=self.duration)
            self._found = state.q.copy()

    def share(self, t: float) -> float:
        """Return the law's share s at time t [s]."""
        return 0.0 if self._schedule is None else self._schedule.weight(t)

    def blend(self, state: RobotState, a: Array) -> Array:
        """Return the mixture with the law's acceleration, shape (nv,)."""
        s = self.share(state.t)
        if s >= 1.0:
            return a
        w = self.natural_frequency
        away = state.robot.difference(state.q, self._found)
        return np.asarray((1.0 - s) * (w * w * away - 2.0 * w * state.v) + s * a)
