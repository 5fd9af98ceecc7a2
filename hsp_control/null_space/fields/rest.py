"""Fields that ask for nothing: self-motion comes to rest, or is left alone."""

from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.fields.field import FieldSample, NullSpaceField
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import Robot, RobotState


class Rest(NullSpaceField):
    """g = 0: the paper's second simulation."""

    def __init__(self, robot: Robot, name: str = "rest") -> None:
        """Set the field."""
        super().__init__(robot, name)

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write zeros."""
        out.g[:] = 0.0
        out.g_dot[:] = 0.0
        return out

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Write zeros, which nothing changes, and return nothing to do."""
        self.evaluate(state, metric, form, out)
        return StepPlan()

    def value(self, state: RobotState) -> float:
        """Return 0."""
        return 0.0


class Uncontrolled(Rest):
    """φ_N = 0: the paper's first simulation, and its warning.

    The task is tracked all the same, but nothing holds the self-motion: the joints run
    away, unseen by the task. To see, not to use.
    """

    controls = False

    def __init__(self, robot: Robot, name: str = "uncontrolled") -> None:
        """Set the field."""
        super().__init__(robot, name)
