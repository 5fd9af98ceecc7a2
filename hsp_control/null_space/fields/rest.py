"""Fields without a goal: self-motion comes to rest, or is not controlled."""

from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.fields.field import FieldSample, NullSpaceField
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import Robot, RobotState


class Rest(NullSpaceField):
    """g = 0: self-motion comes to rest. The paper's second simulation."""

    def __init__(self, robot: Robot, name: str = "rest") -> None:
        """Set the robot, and the name of the field in the log."""
        super().__init__(robot, name)

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write g = 0 and g' = 0; see `NullSpaceField.evaluate`."""
        out.g[:] = 0.0
        out.g_dot[:] = 0.0
        return out

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Write zeros once, and return an empty step plan."""
        self.evaluate(state, metric, form, out)
        return StepPlan()

    def value(self, state: RobotState) -> float:
        """Return 0."""
        return 0.0


class Uncontrolled(Rest):
    """φ_N = 0: self-motion is not controlled. The paper's first simulation.

    Only for demonstration. The task is tracked, but nothing damps the self-motion, and
    the joints drift away while the task error shows nothing.
    """

    controls = False

    def __init__(self, robot: Robot, name: str = "uncontrolled") -> None:
        """Set the robot, and the name of the field in the log."""
        super().__init__(robot, name)
