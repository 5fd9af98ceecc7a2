"""Costs whose value, gradient and exact rate come from one kernel."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.fields.cost import Cost, descend
from hsp_control.null_space.fields.field import FieldSample
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import Robot, RobotState

Derivatives = Callable[[], float]
"""What writes ∇f and (∇f)' and returns f, bound to a state and to where it writes."""


class CompiledCost(Cost):
    """A cost of which `_compile` says all."""

    def __init__(self, robot: Robot, name: str) -> None:
        """Keep the robot and the name, allocate."""
        super().__init__(robot, name)
        self._own = np.zeros(robot.nv), np.zeros(robot.nv)
        self._asked: tuple[RobotState, Derivatives] | None = None
        self._into: tuple[RobotState, Array, Array, Derivatives] | None = None

    @abstractmethod
    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        """Return what writes ∇f and (∇f)' at whatever the state then is."""

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return what `evaluate` does; see `NullSpaceField.bind`."""
        derivatives = self._compile(state, out.g, out.g_dot)
        down = bind(descend, metric.L, metric.W_dot, form, *out)
        return StepPlan(write=(derivatives, down))

    def value(self, state: RobotState) -> float:
        """Return f."""
        return float(self._of(state)())

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f, exact."""
        self._of(state)()
        return self._own[0].copy()

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)', exact."""
        self._of(state)()
        return self._own[1].copy()

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        """Write ∇f and (∇f)'; see `Cost.differentiate`."""
        bound = self._into
        if (
            bound is None
            or bound[0] is not state
            or bound[1] is not gradient
            or bound[2] is not rate
        ):
            derivatives = self._compile(state, gradient, rate)
            self._into = bound = state, gradient, rate, derivatives
        bound[3]()

    def _of(self, state: RobotState) -> Derivatives:
        """Return what writes into memory of its own."""
        if self._asked is None or self._asked[0] is not state:
            self._asked = state, self._compile(state, *self._own)
        return self._asked[1]

    def __getstate__(self) -> dict[str, Any]:
        """Return all but what is bound to a state's memory."""
        return super().__getstate__() | {"_asked": None, "_into": None}
