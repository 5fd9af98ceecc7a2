"""The Euclidean metric of the joints: the paper's own."""

from typing import ClassVar

from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.metrics.metric import IDENTITY, Metric, MetricSample
from hsp_control.robot import RobotState


class IdentityMetric(Metric):
    """W = I: every joint's motion counts the same. The sane default."""

    form: ClassVar[int] = IDENTITY

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Return nothing to do."""
        return StepPlan()

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Leave ``out`` as `MetricSample.allocate` made it: the identity."""
        return out
