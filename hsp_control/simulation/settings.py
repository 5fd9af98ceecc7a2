"""What a configuration says about the simulation of a run."""

from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import Flag, Positive
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.simulate import check_steps, count_rows


class SimulationSettings(Part, error=SimulationError):
    """Duration, periods and integrator of a simulation."""

    duration: Positive = 10.0
    """Length of the run [s]."""
    log_period: Positive = 0.01
    """Time between two rows of the log [s]."""
    control_period: Positive | None = None
    """Time for which an effort is held [s]; without it, the law is evaluated in every
    stage of the integrator."""
    check_rate: Flag = True
    """Whether the loop is checked for stability at its control period: an unstable loop
    is an error, a doubtful one a warning. Without a control period nothing is done."""
    integrator: Integrator | None = None
    """The integrator of the robot's motion; by default ``rk4`` in steps of at most 1 ms
    for the plant ``rigid_body`` under efforts that are held, and otherwise
    ``dop853``."""

    def __post_init__(self) -> None:
        count_rows(self.duration, self.log_period, self.control_period)
        if self.integrator is None or (step := self.integrator.longest_step) is None:
            return
        period = "control_period" if self.control_period else "log_period"
        whole = self.control_period or self.log_period
        ratio = whole / step
        with within("integrator", "step"):
            check_steps(self.duration, step, "step")
            if ratio < 1.0 - 1e-9 or abs(ratio - round(ratio)) > 1e-6 * ratio:
                raise SimulationError(
                    f"{step:g} s is not an integer fraction of {period} = {whole:g} s"
                )
