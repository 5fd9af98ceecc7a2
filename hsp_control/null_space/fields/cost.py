"""Costs f(q, t): the field is their steepest descent, g = -W⁻¹∇f."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.law import VARYING, FieldSample, MetricSample, raise_covector
from hsp_control.null_space.differences import gradient, rate_along_flow
from hsp_control.null_space.fields.field import NullSpaceField
from hsp_control.robot import RobotState


class Cost(NullSpaceField):
    """g = -W⁻¹∇f: the gradient descent of a cost f(q, t), of any sign.

    While the end effector is at rest, q converges to a local minimum of f under the
    constraint of the task, with any metric (Proposition 3).

    A subclass declares its parameters as fields and implements `value`::

        class ElbowHeight(hsp.Cost, type="elbow_height"):
            \"\"\"The elbow stays at a height.\"\"\"

            frame: str
            \"\"\"Name of the elbow's frame.\"\"\"
            height: Number
            \"\"\"The height [m].\"\"\"

            def value(self, state: RobotState) -> float:
                return (state.position(self.frame)[2] - self.height) ** 2

    It may override these methods, which by default use differences (error about 1e-9):

    * `gradient` returns ∇f in the tangent space, shape (nv,).
    * `gradient_rate` returns (∇f)' = ∇²f v + ∂∇f/∂t, shape (nv,).
    * `differentiate` writes both, where one computation gives both.

    f and ∇f depend on q and t only, not on v. The unit of f is chosen such that
    -W⁻¹∇f is in rad/s and m/s. `CompiledCost` is the base class for costs whose
    derivatives come from kernels.
    """

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Reset `differentiate` and `compile` if a subclass overrides what they use."""
        super().__init_subclass__(**arguments)
        own = vars(cls)
        if "differentiate" not in own and {"gradient", "gradient_rate"} & own.keys():
            cls.differentiate = Cost.differentiate  # type: ignore[method-assign]
        derivatives = {"differentiate", "gradient", "gradient_rate"}
        if "compile" not in own and derivatives & own.keys():
            cls.compile = Cost.compile  # type: ignore[method-assign]

    @abstractmethod
    def value(self, state: RobotState) -> float:
        """Return f(q, t), which must not depend on v."""

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f in the tangent space, shape (nv,); by default by differences."""
        return gradient(self.value, state)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)' = ∇²f v + ∂∇f/∂t, shape (nv,); by default by differences."""
        return rate_along_flow(self.gradient, state)

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        """Write ∇f and (∇f)'; by default it calls `gradient` and `gradient_rate`.

        Args:
            state: The robot's state.
            gradient: ∇f, written, shape (nv,).
            rate: (∇f)', written, shape (nv,).

        Raises:
            FieldError: If either is not numeric or does not have shape (nv,).
        """
        nv = state.robot.nv
        gradient[:] = self._tangent(self.gradient(state), "gradient", nv)
        rate[:] = self._tangent(self.gradient_rate(state), "gradient rate", nv)

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write g = -W⁻¹∇f and g' = -W⁻¹((∇f)' + W'g).

        Raises:
            FieldError: If the gradient or its rate is not nv finite numbers.
        """
        self._evaluate(state, lambda: descend(metric.L, metric.W_dot, form, *out), out)
        return out

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return the step plan; see `NullSpaceField.compile`."""
        descent = bind(descend, metric.L, metric.W_dot, form, *out)
        return StepPlan(write=(partial(self._evaluate, state, descent, out),))

    def _evaluate(
        self, state: RobotState, descent: Callable[[], bool], out: FieldSample
    ) -> None:
        self.differentiate(state, out.g, out.g_dot)
        if not descent():
            raise FieldError(
                f"cost {self.name!r} has the gradient {self.gradient(state)!r} and the "
                f"gradient rate {self.gradient_rate(state)!r} at t = {state.t:.6g} s; "
                "needs finite numbers"
            )

    def _tangent(self, value: Array, what: str, nv: int) -> Array:
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            raise FieldError(
                f"cost {self.name!r} has the {what} {value!r}; needs numbers"
            ) from None
        if array.shape != (nv,):
            raise FieldError(
                f"cost {self.name!r} has a {what} of shape {array.shape}; "
                f"needs ({nv},): the tangent space, not the configuration"
            )
        return array


class FunctionCost(Cost):
    """f = function(state): a cost given as a Python function.

    YAML cannot say it: declare a subclass of `Cost` for that.
    """

    function: Callable[[RobotState], float]
    """f of a state, one number [rad²/s, m²/s]; it may use q, t and frames, but not
    v."""
    _: KW_ONLY
    gradient_function: Callable[[RobotState], Array] | None = None
    """∇f of a state in the tangent space, shape (nv,) [rad/s, m/s]; by differences by
    default."""
    rate_function: Callable[[RobotState], Array] | None = None
    """(∇f)' = ∇²f v + ∂∇f/∂t of a state, shape (nv,) [rad/s², m/s²]; by differences by
    default."""

    def value(self, state: RobotState) -> float:
        """Return f."""
        value = self.function(state.seen)
        try:
            number = float(value)
        except (TypeError, ValueError):
            number = np.nan
        if not np.isfinite(number):
            raise FieldError(
                f"cost {self.name!r} returned {value!r} at t = {state.t:.6g} s; "
                "needs one finite number"
            )
        return number

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f from the given function, or by differences."""
        if self.gradient_function is None:
            return super().gradient(state)
        return self.gradient_function(state.seen)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)' from the given function, or by differences along the flow."""
        if self.rate_function is None:
            return super().gradient_rate(state)
        return self.rate_function(state.seen)


@kernel
def descend(L: Array, W_dot: Array, form: int, g: Array, g_dot: Array) -> bool:
    """Overwrite (∇f, (∇f)') by g = -W⁻¹∇f and g'; return whether all are finite."""
    raise_covector(g, L, form)
    total = 0.0
    for i in range(g.shape[0]):
        g[i] = -g[i]
    for i in range(g.shape[0]):
        if form == VARYING:
            for j in range(g.shape[0]):
                g_dot[i] += W_dot[i, j] * g[j]
        g_dot[i] = -g_dot[i]
    raise_covector(g_dot, L, form)
    for i in range(g.shape[0]):
        total += g[i] + g_dot[i]
    return bool(np.isfinite(total))


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
