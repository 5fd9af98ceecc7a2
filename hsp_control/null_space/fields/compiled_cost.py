"""The base class of costs whose derivatives come from kernels."""

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.identity_cache import IdentityCache, without_caches
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.fields.cost import Cost, descend
from hsp_control.null_space.fields.field import FieldSample
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import Robot, RobotState

Derivatives = Callable[[], float]
"""A call that reads a state, writes ∇f and (∇f)', and returns f."""


class CompiledCost(Cost):
    """g = -W⁻¹∇f with f, ∇f and (∇f)' from one call: a subclass implements `_compile`.

    `value`, `gradient` and `gradient_rate` follow from it and are exact.
    """

    def __init__(self, robot: Robot, name: str) -> None:
        """Set the robot, and the name of the field in the log."""
        super().__init__(robot, name)
        self._own = np.zeros(robot.nv), np.zeros(robot.nv)

    @abstractmethod
    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        """Return a call that writes ∇f and (∇f)' and returns f.

        Args:
            state: The state that the call reads. Its values change between calls.
            gradient: The array that the call writes ∇f into, shape (nv,).
            rate: The array that the call writes (∇f)' into, shape (nv,).
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
        return float(self._own_derivatives.get(state)())

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f, exact, shape (nv,)."""
        self._own_derivatives.get(state)()
        return self._own[0].copy()

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)', exact, shape (nv,)."""
        self._own_derivatives.get(state)()
        return self._own[1].copy()

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        """Write ∇f and (∇f)'; see `Cost.differentiate`."""
        self._derivatives.get(state, gradient, rate)()

    @cached_property
    def _own_derivatives(self) -> IdentityCache[Derivatives]:
        return IdentityCache(self._compile_own)

    @cached_property
    def _derivatives(self) -> IdentityCache[Derivatives]:
        return IdentityCache(self._compile)

    def __getstate__(self) -> dict[str, Any]:
        return without_caches(self)

    def _compile_own(self, state: RobotState) -> Derivatives:
        """Return the call that writes into the cost's own arrays."""
        return self._compile(state, *self._own)
