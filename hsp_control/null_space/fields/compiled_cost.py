"""The base class of costs whose derivatives come from kernels."""

from abc import abstractmethod
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.law import FieldSample, MetricSample
from hsp_control.null_space.fields.cost import Cost, descend
from hsp_control.robot import RobotState

Derivatives = Callable[[], float]
"""A call that reads a state, writes ∇f and (∇f)', and returns f."""


class _Own(NamedTuple):
    gradient: Array
    rate: Array
    derivatives: Derivatives


class CompiledCost(Cost):
    """g = -W⁻¹∇f with f, ∇f and (∇f)' from one call: a subclass implements `_compile`.

    `value`, `gradient` and `gradient_rate` follow from it and are exact.
    """

    @abstractmethod
    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        """Return a call that writes ∇f and (∇f)' and returns f.

        Shapes: gradient (nv,), rate (nv,).
        """

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return the step plan; see `NullSpaceField.compile`."""
        derivatives = self._compile(state, out.g, out.g_dot)
        to_field = bind(descend, metric.L, metric.W_dot, form, *out)
        return StepPlan(write=(derivatives, to_field))

    def value(self, state: RobotState) -> float:
        """Return f."""
        return float(self._own(state).derivatives())

    def bind_value(self, state: RobotState) -> Derivatives:
        """Return the call of `value`."""
        return self._own(state).derivatives

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f, exact, shape (nv,)."""
        own = self._own(state)
        own.derivatives()
        return own.gradient.copy()

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)', exact, shape (nv,)."""
        own = self._own(state)
        own.derivatives()
        return own.rate.copy()

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        """Write ∇f and (∇f)'; see `Cost.differentiate`."""
        own = self._own(state)
        own.derivatives()
        gradient[:], rate[:] = own.gradient, own.rate

    def _own(self, state: RobotState) -> _Own:
        """Return the call that writes into memory of its own."""

        def make() -> _Own:
            gradient, rate = np.zeros((2, state.robot.nv))
            return _Own(gradient, rate, self._compile(state, gradient, rate))

        return state.made(self, "derivatives", make)
