"""User-defined rates of a field, its weight or a metric, against differences.

V' = -e_NᵀW K_N e_N needs the g' of this g; a wrong one shows nowhere, but e_N does not
decay. So g' of a field, ∇f and (∇f)' of a cost, w' of a weight, and W' of a metric are
looked at, where the package did not write them.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import MetricError
from hsp_control.control.declared_rates.comparison import (
    Declared,
    ValueAndRate,
    along_the_flow,
    declared_by,
    independent_of_v,
    is_own,
)
from hsp_control.declaration.language import spoken
from hsp_control.law import IDENTITY, VARYING, FieldSample, MetricSample
from hsp_control.null_space.fields import (
    Cost,
    FunctionCost,
    FunctionField,
    NullSpaceField,
    StateWeight,
    VectorField,
    Weight,
)
from hsp_control.null_space.fields.weight import Product, sample_weight
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.state import as_given

_RATE_BY = (
    "rate", "gradient_rate", "differentiate", "call", "terms", "terms_call",
    "derivatives", "own_calls", "evaluate",
)  # fmt: skip
_GRADIENT_BY = (
    "gradient", "differentiate", "call", "terms", "terms_call", "derivatives",
    "own_calls", "evaluate",
)  # fmt: skip


class _OfField(NamedTuple):
    """A value of a field that must not depend on v, and its rate."""

    declared: Declared  # its `by` is empty where the package uses differences
    at: ValueAndRate
    timed: bool = True  # whether the rate is along t, too

    def check(self, state: RobotState) -> None:
        """Check both at a state."""
        own = self.declared
        instead = spoken("null_space.gain", "null_space_gain")
        instead = f"Self-motion is damped by {instead}"
        words = own.part, own.value, own.entry
        if independent_of_v(*words, self.at, state, instead) and own.by:
            samples = along_the_flow(self.at, state, timed=self.timed)
            own.compare(*samples, state.t)


def check_field(field: NullSpaceField, state: RobotState) -> None:
    """Check the rates of a placed field, and of its weight, at a state.

    Raises:
        RateError: If a value depends on v, or a rate or gradient is not that of the
            value.
    """
    for each in _of_field(field, state.robot):
        each.check(state)


def check_metric(metric: Metric, state: RobotState) -> None:
    """Check a placed metric and its rates at a state; see `check_field`.

    Raises:
        MetricError: If W is not L Lᵀ with a lower triangle L.
    """
    if is_own(type(metric)):
        return

    def sample(state: RobotState) -> MetricSample:
        given = as_given(metric, state)
        return metric.evaluate(given, MetricSample.allocate(state.robot.nv))

    _check_factor(metric, sample(state))
    if metric.form != VARYING:
        return

    def at(state: RobotState) -> tuple[Array, Array]:
        out = sample(state)
        return out.W.ravel(), out.W_dot.ravel()

    def entry(i: int) -> str:
        return f" in row and column {divmod(i, state.robot.nv)}"

    by = declared_by(metric, ("call", "evaluate"))
    part = f"metric {type(metric).__name__}"
    _OfField(Declared(part, by, "W", "W' = ∂W/∂q·v", entry), at).check(state)


def _check_factor(metric: Metric, found: object) -> None:
    """Check W = L Lᵀ up to rounding: so W is symmetric and positive definite."""
    name = type(metric).__name__
    if not isinstance(found, MetricSample):
        raise MetricError(f"{name}.evaluate returns {found!r}; needs out, its sample")
    W, L = found.W, found.L
    finite = np.isfinite(W).all() and np.isfinite(L).all()
    scale = _ROUNDING * np.abs(W).max()
    if not (finite and np.diag(L).min() > 0.0 and np.abs(L @ L.T - W).max() <= scale):
        raise MetricError(
            f"{name}: W is not L Lᵀ; needs a symmetric positive definite W, with its "
            "Cholesky factor L, for example out.L[:] = np.linalg.cholesky(out.W)"
        )
    if np.abs(np.triu(L, 1)).max() > 0.0:
        raise MetricError(f"{name}: L is not a lower triangle")


_ROUNDING = 1e-9
"""Of W's largest entry: a factorisation has 1e-15, a mistake of a user's much more."""


def _of_field(field: NullSpaceField, robot: Robot) -> Iterator[_OfField]:
    """Yield the user-defined rates of a field."""
    given = isinstance(field, FunctionCost | FunctionField)
    if given or not is_own(type(field)):
        yield _rate_of(field, robot)
        if isinstance(field, Cost) and (gradient := _gradient_by(field)):
            yield _gradient_of(field, gradient)
    for weight in _factors(field.weight):
        if isinstance(weight, StateWeight) or not is_own(type(weight)):
            yield _weight_of(field, weight)


def _rate_of(field: NullSpaceField, robot: Robot) -> _OfField:
    """Return g and g' of a field, ∇f and (∇f)' of a cost."""
    sign = -1.0 if isinstance(field, Cost) else 1.0  # g = -∇f in the metric I

    def at(state: RobotState) -> tuple[Array, Array]:
        nv = state.robot.nv
        out = FieldSample.allocate(nv)
        given = as_given(field, state)
        field.evaluate(given, MetricSample.allocate(nv), IDENTITY, out)
        return sign * out.g, sign * out.g_dot

    def entry(i: int) -> str:
        return f" of {robot.dof_names[i]}"

    if isinstance(field, FunctionCost | FunctionField):
        by = "" if field.rate_function is None else "rate_function"
    else:
        by = "" if _differenced(field) else declared_by(field, _RATE_BY)
    words = ("g", "g' = ∂g/∂q·v + ∂g/∂t")
    if isinstance(field, Cost):
        words = ("∇f", "(∇f)' = ∇²f v + ∂∇f/∂t")
    return _OfField(Declared(_named(field), by, *words, entry), at)


def _gradient_of(cost: Cost, by: str) -> _OfField:
    """Return f and ∇f·v of a cost, along q alone."""

    def at(state: RobotState) -> tuple[Array, Array]:
        value = cost.value(state.read_only)
        nv = state.robot.nv
        out = FieldSample.allocate(nv)
        cost.evaluate(as_given(cost, state), MetricSample.allocate(nv), IDENTITY, out)
        return np.array([value]), np.array([-out.g @ state.v])

    words = "f", "∇f·v"
    return _OfField(Declared(_named(cost), by, *words, _only), at, timed=False)


def _gradient_by(cost: Cost) -> str:
    """Return the source of ∇f; empty: computed by differences."""
    if isinstance(cost, FunctionCost):
        return "" if cost.gradient_function is None else "gradient_function"
    return (
        "" if _inherits(cost, Cost, _GRADIENT_BY) else declared_by(cost, _GRADIENT_BY)
    )


def _differenced(field: NullSpaceField) -> bool:
    """Return whether the package computes the rate by differences."""
    base = next((each for each in (Cost, VectorField) if isinstance(field, each)), None)
    return base is not None and _inherits(field, base, _RATE_BY)


def _inherits(field: NullSpaceField, base: type, ways: tuple[str, ...]) -> bool:
    """Return whether a field has all these methods, as far as they exist, of a base."""
    return all(
        getattr(type(field), way) is getattr(base, way)
        for way in ways
        if hasattr(base, way)
    )


def _weight_of(field: NullSpaceField, weight: Weight) -> _OfField:
    """Return w and w' of a weight."""

    def at(state: RobotState) -> tuple[Array, Array]:
        w, w_dot = sample_weight(weight, state.read_only)
        return np.array([w], dtype=float), np.array([w_dot], dtype=float)

    by = "" if isinstance(weight, StateWeight) else declared_by(weight, ("sample",))
    words = "w", "w' = ∂w/∂q·v + ∂w/∂t"
    return _OfField(Declared(f"weight of {_named(field)}", by, *words, _only), at)


def _factors(weight: Weight | float) -> Iterator[Weight]:
    if isinstance(weight, Product):
        yield from _factors(weight.first)
        yield from _factors(weight.second)
    elif isinstance(weight, Weight):
        yield weight


def _named(field: NullSpaceField) -> str:
    return f"{'cost' if isinstance(field, Cost) else 'field'} {field.name!r}"


def _only(_: int) -> str:
    """Return nothing: the value is one number."""
    return ""
