"""The field of rest: self-motion stops."""

from hsp_control.common.step_plan import StepPlan
from hsp_control.law import FieldSample, MetricSample
from hsp_control.null_space.fields.field import NullSpaceField
from hsp_control.robot import RobotState


class Rest(NullSpaceField, type="rest"):
    """g = 0: self-motion comes to rest. The paper's second simulation."""

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
