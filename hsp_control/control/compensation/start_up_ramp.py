"""A smooth transition from holding still to the law."""

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.compensation.stage import Run, Stage
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


class RunningRamp(Stage):
    """A start-up ramp in one run: it knows when and where it began."""

    def __init__(self, declared: StartUpRamp) -> None:
        self._declared = declared
        self._begun: tuple[Schedule, Array] | None = None  # at the first state

    def act(self, run: Run, state: RobotState, active: ActiveStack) -> None:
        """Blend the law's acceleration with what holds still; see `Stage.act`."""
        if self._begun is None:
            schedule = Schedule([(state.t, None)], ramp=self._declared.duration)
            self._begun = schedule, state.q.copy()
        schedule, q0 = self._begun
        s = schedule.weight(state.t)
        run.starting = s < 1.0
        if run.starting:
            w = self._declared.natural_frequency
            away = state.robot.difference(state.q, q0)
            run.a = (1.0 - s) * (w * w * away - 2.0 * w * state.v) + s * run.a
