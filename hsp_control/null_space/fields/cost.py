"""The abstract cost f(q, t), whose field is g = -W⁻¹∇f, and the cost of a function."""

from abc import abstractmethod
from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.null_space.differences import gradient, rate_along_flow
from hsp_control.null_space.fields.field import FieldSample, NullSpaceField
from hsp_control.null_space.metrics import MetricSample
from hsp_control.null_space.metrics.metric import VARYING, raise_covector
from hsp_control.robot import Robot, RobotState


class Cost(NullSpaceField):
    """g = -W⁻¹∇f: the gradient descent of a cost f(q, t), of any sign.

    While the end effector is at rest, q converges to a local minimum of f under the
    constraint of the task, with any metric (Proposition 3).

    A subclass calls ``super().__init__(robot, name)`` and implements `value`. It may
    override these methods, which by default use differences (error about 1e-9):

    * `gradient` returns ∇f in the tangent space, shape (nv,).
    * `gradient_rate` returns (∇f)' = ∇²f v + ∂∇f/∂t, shape (nv,).
    * `differentiate` writes both, where one computation gives both.

    f and ∇f depend on q and t only, not on v. The unit of f is chosen such that
    -W⁻¹∇f is in rad/s and m/s. `CompiledCost` is the base class for costs whose
    derivatives come from kernels.
    """

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Reset `differentiate` and `compile` if a subclass overrides what they use.

        Otherwise a subclass of a concrete cost would inherit a method that ignores its
        gradient or its gradient rate.
        """
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
        gradient[:] = self._tangent(self.gradient(state), "gradient")
        rate[:] = self._tangent(self.gradient_rate(state), "gradient rate")

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write g = -W⁻¹∇f and g' = -W⁻¹((∇f)' + W'g).

        Raises:
            FieldError: If the gradient or its rate is not nv finite numbers.
        """
        self.differentiate(state, out.g, out.g_dot)
        if not self._descent.get(metric, form, out)():
            raise FieldError(
                f"cost {self.name!r} has the gradient {self.gradient(state)!r} and the "
                f"gradient rate {self.gradient_rate(state)!r} at t = {state.t:.6g} s; "
                "needs finite numbers"
            )
        return out

    @cached_property
    def _descent(self) -> IdentityCache[Callable[[], bool]]:
        """The call that turns (∇f, (∇f)') into (g, g'), in place."""
        return IdentityCache(_compile_descent)

    def _tangent(self, value: Array, what: str) -> Array:
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            raise FieldError(
                f"cost {self.name!r} has the {what} {value!r}; needs numbers"
            ) from None
        if array.shape != (self.robot.nv,):
            raise FieldError(
                f"cost {self.name!r} has a {what} of shape {array.shape}; "
                f"needs ({self.robot.nv},): the tangent space, not the configuration"
            )
        return array


class FunctionCost(Cost):
    """f = function(state): a cost given as a Python function."""

    def __init__(
        self,
        robot: Robot,
        function: Callable[[RobotState], float],
        *,
        gradient: Callable[[RobotState], Array] | None = None,
        gradient_rate: Callable[[RobotState], Array] | None = None,
        name: str = "function",
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            function: f of a state, one number; it may use q, t and frames, but not v.
            gradient: ∇f of a state in the tangent space, shape (nv,); None: by
                differences.
            gradient_rate: (∇f)' = ∇²f v + ∂∇f/∂t of a state, shape (nv,); None: by
                differences.
            name: Name of the field in the log.
        """
        super().__init__(robot, name)
        self._function = function
        self._gradient = gradient
        self._gradient_rate = gradient_rate

    def value(self, state: RobotState) -> float:
        """Return f.

        Raises:
            FieldError: If the function does not return one finite number.
        """
        value = self._function(state)
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
        if self._gradient is None:
            return super().gradient(state)
        return self._gradient(state)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)' from the given function, or by differences along the flow."""
        if self._gradient_rate is None:
            return super().gradient_rate(state)
        return self._gradient_rate(state)


def _compile_descent(
    metric: MetricSample, form: int, out: FieldSample
) -> Callable[[], bool]:
    return bind(descend, metric.L, metric.W_dot, form, *out)


@kernel
def descend(L: Array, W_dot: Array, form: int, g: Array, g_dot: Array) -> bool:
    """Overwrite (∇f, (∇f)') by g = -W⁻¹∇f and g' = -W⁻¹((∇f)' + W'g).

    Return whether all entries are finite.
    """
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
