"""The Euclidean metric of the joints, used by the paper."""

from typing import ClassVar

from hsp_control.common.step_plan import StepPlan
from hsp_control.law import IDENTITY, MetricSample
from hsp_control.null_space.metrics.metric import Metric
from hsp_control.robot import RobotState


class IdentityMetric(Metric, type="identity"):
    """W = I: the motions of all joints count the same. The default."""

    form: ClassVar[int] = IDENTITY

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Return an empty step plan: ``out`` is the identity already."""
        return StepPlan()

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Return ``out`` unchanged: `MetricSample.allocate` returns the identity."""
        return out
