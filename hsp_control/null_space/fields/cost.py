"""Costs f(q, t): the field is their steepest descent, g = -W⁻¹∇f."""

from collections.abc import Callable
from dataclasses import KW_ONLY
from typing import Annotated, Any, NoReturn

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FieldError
from hsp_control.declaration.imported import AS_TEXT, NAMED
from hsp_control.engine.plans import PartCall, PartCalls, implemented_by
from hsp_control.law import FieldSample, MetricSample
from hsp_control.null_space.fields.field import NullSpaceField
from hsp_control.robot import RobotState
from hsp_control.robot.differences import gradient, rate_along_flow

_BY_KERNEL = "call", "derivatives"


class Cost(NullSpaceField):
    """g = -W⁻¹∇f: the gradient descent of a cost f(q, t), of any sign.

    While the end effector is at rest, q converges to a local minimum of f under the
    task's constraint, in any metric (Proposition 3).

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
    * `differentiate` writes both, if one computation gives both.

    Or it implements `call` alone, which computes f and both derivatives at once.

    f and ∇f depend on q and t only, not on v. The unit of f is chosen such that
    -W⁻¹∇f is in rad/s and m/s.
    """

    def call(self, state: RobotState) -> PartCall:
        """Return a kind of call with its arguments, without ``gradient`` and ``rate``.

        With these two it writes ∇f and (∇f)', shapes (nv,), and returns f; see
        `Task.call` for its arguments.
        """
        raise TypeError(f"{type(self).__name__} implements neither call nor value")

    def derivatives(self, state: RobotState, gradient: Array, rate: Array) -> PartCalls:
        """Return the calls that write ∇f and (∇f)' with `call`, and return f."""
        return [self.call(state).given(gradient=gradient, rate=rate)]

    def _has_kernel(self, *ways: str) -> bool:
        """Return whether no subclass overrides any of these methods in plain Python."""
        return implemented_by(self, "call", "derivatives", *ways, "value") in _BY_KERNEL

    def value(self, state: RobotState) -> float:
        """Return f(q, t), which must not depend on v."""
        return float(self._derived(state)[1]())

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f in the tangent space, shape (nv,); by default by differences."""
        if not self._has_kernel():
            return gradient(self.value, state)
        return self._derivative(state, 0)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)' = ∇²f v + ∂∇f/∂t, shape (nv,); by default by differences."""
        if not self._has_kernel("gradient"):
            return rate_along_flow(self.gradient, state)
        return self._derivative(state, 1)

    def differentiate(self, state: RobotState, gradient: Array, rate: Array) -> None:
        """Write ∇f and (∇f)'; by default it calls `gradient` and `gradient_rate`.

        Args:
            state: The robot's state.
            gradient: ∇f, written, shape (nv,).
            rate: (∇f)', written, shape (nv,).

        Raises:
            FieldError: If either is not numeric or does not have shape (nv,).
        """
        self._by_each(state, gradient, rate)

    def _by_each(self, state: RobotState, gradient: Array, rate: Array) -> None:
        nv = state.robot.nv
        gradient[:] = self._tangent(self.gradient(state), "gradient", nv)
        rate[:] = self._tangent(self.gradient_rate(state), "gradient rate", nv)

    def own_calls(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> PartCalls:
        """Return the calls: g = -W⁻¹∇f and g' = -W⁻¹((∇f)' + W'g)."""
        descend = descent(metric, form, out)
        if self._has_kernel("gradient", "gradient_rate", "differentiate"):
            return [*self.derivatives(state, *out), descend]
        write = PartCall(
            self._differentiated, state=state.read_only, gradient=out.g, rate=out.g_dot
        )
        return [write, descend]

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write g and g'; see `NullSpaceField.evaluate`.

        Raises:
            FieldError: If the gradient or its rate is not nv finite numbers.
        """
        super().evaluate(state, metric, form, out)
        if not np.isfinite([*out]).all():
            self._raise_not_finite(state)
        return out

    def _differentiated(self, state: RobotState, gradient: Array, rate: Array) -> None:
        by_both = implemented_by(self, "differentiate", "gradient", "gradient_rate")
        known = self.differentiate if by_both == "differentiate" else self._by_each
        known(state, gradient, rate)
        if not np.isfinite(gradient.sum() + rate.sum()):
            self._raise_not_finite(state)

    def _raise_not_finite(self, state: RobotState) -> NoReturn:
        self.value(state)  # may raise a more precise error
        raise FieldError(
            f"cost {self.name!r} has the gradient {self.gradient(state)!r} and the "
            f"gradient rate {self.gradient_rate(state)!r} at t = {state.t:.6g} s; "
            "needs finite numbers"
        )

    def _derivative(self, state: RobotState, which: int) -> Array:
        """Return ∇f (0) or (∇f)' (1) of the call, shape (nv,)."""
        both, run = self._derived(state)
        run()
        return np.array(both[which])

    def _derived(self, state: RobotState) -> tuple[Array, Callable[[], Any]]:
        """Return ∇f and (∇f)', (2, nv), and the call that writes them and returns f."""

        def make() -> tuple[Array, PartCalls]:
            both = np.zeros((2, state.robot.nv))
            return both, self.derivatives(state, *both)

        return state.prepared(self, "derivatives", make)

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


class FunctionCost(Cost, type="function_cost"):
    """f = function(state): a cost given as a Python function.

    YAML gives the function's name, and ``hsp run --import FILE.py`` runs the file that
    contains it. A subclass of `Cost` can have parameters.
    """

    function: Annotated[Callable[[RobotState], float], NAMED, AS_TEXT]
    """f of a state, one number [rad²/s, m²/s]; it may use q, t and frames, but not
    v."""
    _: KW_ONLY
    gradient_function: (
        Annotated[Callable[[RobotState], Array], NAMED, AS_TEXT] | None
    ) = None
    """∇f of a state in the tangent space, shape (nv,) [rad/s, m/s]; by differences by
    default."""
    rate_function: Annotated[Callable[[RobotState], Array], NAMED, AS_TEXT] | None = (
        None
    )
    """(∇f)' = ∇²f v + ∂∇f/∂t of a state, shape (nv,) [rad/s², m/s²]; by differences by
    default."""

    def value(self, state: RobotState) -> float:
        """Return f."""
        value = self.function(state.read_only)
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
        return self.gradient_function(state.read_only)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return (∇f)' from the given function, or by differences along the flow."""
        if self.rate_function is None:
            return super().gradient_rate(state)
        return self.rate_function(state.read_only)


def descent(metric: MetricSample, form: int, out: FieldSample) -> PartCall:
    """Return the call that overwrites ∇f and (∇f)' by g = -W⁻¹∇f and g'."""
    return PartCall(
        engine.GradientDescent, L=metric.L, W_dot=metric.W_dot, form=form, field=out
    )
