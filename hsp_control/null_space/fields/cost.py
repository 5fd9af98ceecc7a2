"""Costs f(q, t): their field is the gradient raised with the metric, g = -W⁻¹∇f."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.null_space.differences import gradient, rate_along_flow
from hsp_control.null_space.fields.field import FieldSample, NullSpaceField
from hsp_control.null_space.metrics import MetricSample
from hsp_control.null_space.metrics.metric import VARYING, raise_covector
from hsp_control.robot import Robot, RobotState


class Cost(NullSpaceField):
    """A scalar cost f(q, t) ≥ or ≤ anything, descended along g = -W⁻¹∇f.

    With the end effector held, q converges to the constrained local minimum
    (Proposition 3), in every metric. To implement one, write `value`; write `gradient`
    where it has a closed form, and `gradient_rate` where that is short. What is left
    out is computed by differences, exact to about 1e-9.
    """

    _bound: tuple[MetricSample, int, FieldSample, Callable[[], bool]] | None = None

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Let a gradient or a rate that is overridden count, also of a ready cost."""
        super().__init_subclass__(**arguments)
        own = vars(cls)
        if "differentiate" not in own and {"gradient", "gradient_rate"} & own.keys():
            cls.differentiate = Cost.differentiate  # type: ignore[method-assign]
        derivatives = {"differentiate", "gradient", "gradient_rate"}
        if "compile" not in own and derivatives & own.keys():
            cls.compile = Cost.compile  # type: ignore[method-assign]

    @abstractmethod
    def value(self, state: RobotState) -> float:
        """Return f(q, t); it may not depend on the velocity."""

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f in the tangent space, shape (nv,)."""
        return gradient(self.value, state)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)' = ∇²f v + ∂∇f/∂t, shape (nv,)."""
        return rate_along_flow(self.gradient, state)

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        """Write ∇f and (∇f)', shape (nv,) each, where both are wanted.

        Raises:
            FieldError: If either is not nv numbers.
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
        bound = self._bound
        if (
            bound is None
            or bound[0] is not metric
            or bound[1] != form
            or bound[2] is not out
        ):
            self._bound = bound = (
                metric,
                form,
                out,
                bind(descend, metric.L, metric.W_dot, form, *out),
            )
        if not bound[3]():
            raise FieldError(
                f"cost {self.name!r} has the gradient {self.gradient(state)!r} and the "
                f"gradient rate {self.gradient_rate(state)!r} at t = {state.t:.6g} s; "
                "needs finite numbers"
            )
        return out

    def __getstate__(self) -> dict[str, Any]:
        """Return all but what is bound to another's memory."""
        return self.__dict__ | {"_bound": None}

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
    """A user's own cost, given as a Python function of the state."""

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
            function: f of a state; it reads q, t and frames, not v.
            gradient: ∇f of a state in the tangent space, shape (nv,), if known.
            gradient_rate: (∇f)' of a state, shape (nv,), if known.
            name: What the log calls it.
        """
        super().__init__(robot, name)
        self._function = function
        self._gradient = gradient
        self._gradient_rate = gradient_rate

    def value(self, state: RobotState) -> float:
        """Return the function's value.

        Raises:
            FieldError: If it is not one finite number.
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
        """Return the given gradient, or differences."""
        if self._gradient is None:
            return super().gradient(state)
        return self._gradient(state)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return the given rate, or differences along the flow."""
        if self._gradient_rate is None:
            return super().gradient_rate(state)
        return self._gradient_rate(state)


@kernel
def descend(L: Array, W_dot: Array, form: int, g: Array, g_dot: Array) -> bool:
    """Overwrite (∇f, (∇f)') by (-W⁻¹∇f, -W⁻¹((∇f)' + W'g)); return if finite."""
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
