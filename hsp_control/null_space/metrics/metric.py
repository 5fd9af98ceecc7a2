"""The abstract joint-space metric."""

from abc import ABC, abstractmethod
from functools import partial
from typing import Any, ClassVar, Self

from hsp_control.common.exceptions import MetricError
from hsp_control.common.step_plan import StepPlan
from hsp_control.declaration import Part
from hsp_control.geometry.start import Start
from hsp_control.law import MetricSample
from hsp_control.robot import RobotState


class Metric(Part, ABC, family="metrics", error=MetricError):
    """‖v‖²_W = vᵀ W(q) v: a joint-space metric, W symmetric positive definite.

    The law minimises joint motion in this norm: the pseudo-inverse is
    J# = W⁻¹Jᵀ(JW⁻¹Jᵀ)⁻¹, the null-space projector P = I - J#J, and the field of a cost
    -W⁻¹∇f. W acts on the tangent space: v has shape (nv,) and is in rad/s and m/s.

    A subclass declares its parameters as fields (see `Part`), sets `form` to CONSTANT
    or VARYING and implements `evaluate`; if W is constant, derive from `FixedMetric`
    instead. It may override `placed`, and `compile` to make a step faster (by default
    the step plan calls `evaluate` at every step). A metric has no memory: what a
    computation needs is kept by the state (see `RobotState.made`).

    Attributes:
        form: IDENTITY, CONSTANT or VARYING, by which the law skips terms that are zero.
    """

    form: ClassVar[int]

    def placed(self, start: Start) -> Self:
        """Return the metric for a robot and a start, checked.

        What is omitted because the robot knows it is replaced by numbers. By default
        nothing is, and every robot fits.

        Raises:
            MetricError: If the metric does not fit the robot.
        """
        return self

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Reset `compile` if a subclass overrides `evaluate`, which it would ignore."""
        super().__init_subclass__(**arguments)
        if "evaluate" in vars(cls) and "compile" not in vars(cls):
            cls.compile = Metric.compile  # type: ignore[method-assign]

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Return the step plan that does what `evaluate` does; may be overridden.

        Args:
            state: The state that every step reads. Its values change between steps.
            out: The sample that every step writes.
        """
        return StepPlan(write=(partial(self.evaluate, state, out),))

    @abstractmethod
    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W = L Lᵀ and W' at a state into ``out`` and return ``out``.

        ``out`` is the identity with W' = 0 before the first call; entries that never
        change from that need not be written.

        Args:
            state: The robot's state: t, q, v and the kinematics.
            out: The sample to write into, shapes (nv, nv).
        """
