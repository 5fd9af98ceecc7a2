"""Derivatives that somebody has written are compared with a difference, once.

V' = -e_NᵀW K_N e_N needs the g' of this g; a wrong one shows nowhere, but e_N does not
decay. So where a run begins, what the package did not write of a field is looked at:
g' of a field, ∇f and (∇f)' of a cost, w' of a weight, W' of a metric. That is done on a
state of its own, and along q ⊕ s v with a velocity that turns every joint, since a
robot mostly begins at rest.

A value that is differentiable has the same slope over four intervals in a row, and its
rate is that slope. Where the slopes differ, because a kink, a jump or noise lies among
them, the rate may be anything within a few times their spread, and nothing is reported.
"""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import RateError
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

_INTERVAL = 5e-5
"""Time between two of the five states [s], along joints that turn at up to 1 rad/s."""
_ALLOWED = 1e-3
"""A rate may be wrong by this part of it: sampling at 1 kHz does twice as much."""
_SPREADS = 2.0
"""It may be off by this many spreads of the slopes: a jump at the middle state has a
mean slope of half its spread, and any finite rate is right there."""
_ROUNDINGS = 8.0
"""Units in the last place of the value that a difference may consist of."""
_SAME = 1e-6
"""Values that differ by less than this part are the same [-]."""

_RATE_BY = (
    "rate", "gradient_rate", "differentiate", "call", "terms", "terms_call",
    "derivatives", "own_calls", "evaluate",
)  # fmt: skip
_GRADIENT_BY = (
    "gradient", "differentiate", "call", "terms", "terms_call", "derivatives",
    "own_calls", "evaluate",
)  # fmt: skip


class _Declared(NamedTuple):
    """A value, and the rate of it that somebody has declared."""

    part: str  # whose it is
    by: str  # what declares the rate; empty: the package takes it by differences
    value: str  # what the value is called
    rate: str  # what the rate is called
    entry: Callable[[int], str]  # of which an entry of either is
    at: Callable[[RobotState], tuple[Array, Array]]  # value and rate, shape (n,) each
    timed: bool = True  # whether the rate is along t, too


def check_field(field: NullSpaceField, state: RobotState) -> None:
    """Check what a placed field, and its weight, declare at a state.

    Raises:
        RateError: If a value depends on v, or a rate or gradient is not that of the
            value.
    """
    for each in _of_field(field, state.robot):
        _check(each, state)


def check_metric(metric: Metric, state: RobotState) -> None:
    """Check what a placed metric declares at a state; see `check_field`."""
    if _is_own(type(metric)) or metric.form != VARYING:
        return

    def at(state: RobotState) -> tuple[Array, Array]:
        given = as_given(metric, state)
        out = metric.evaluate(given, MetricSample.allocate(state.robot.nv))
        return out.W.ravel(), out.W_dot.ravel()

    def entry(i: int) -> str:
        return f" in row and column {divmod(i, state.robot.nv)}"

    by = _by(metric, ("call", "evaluate"))
    part = f"metric {type(metric).__name__}"
    _check(_Declared(part, by, "W", "W' = ∂W/∂q·v", entry, at), state)


def _of_field(field: NullSpaceField, robot: Robot) -> Iterator[_Declared]:
    """Yield what somebody has declared of a field."""
    given = isinstance(field, FunctionCost | FunctionField)
    if given or not _is_own(type(field)):
        yield _rate_of(field, robot)
        if isinstance(field, Cost) and (gradient := _gradient_by(field)):
            yield _gradient_of(field, gradient)
    for weight in _factors(field.weight):
        if isinstance(weight, StateWeight) or not _is_own(type(weight)):
            yield _weight_of(field, weight)


def _rate_of(field: NullSpaceField, robot: Robot) -> _Declared:
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
        by = "" if _differenced(field) else _by(field, _RATE_BY)
    words = ("g", "g' = ∂g/∂q·v + ∂g/∂t")
    if isinstance(field, Cost):
        words = ("∇f", "(∇f)' = ∇²f v + ∂∇f/∂t")
    return _Declared(_named(field), by, *words, entry, at)


def _gradient_of(cost: Cost, by: str) -> _Declared:
    """Return f and ∇f·v of a cost, along q alone."""

    def at(state: RobotState) -> tuple[Array, Array]:
        value = cost.value(state.read_only)
        nv = state.robot.nv
        out = FieldSample.allocate(nv)
        cost.evaluate(as_given(cost, state), MetricSample.allocate(nv), IDENTITY, out)
        return np.array([value]), np.array([-out.g @ state.v])

    words = "f", "∇f·v"
    return _Declared(_named(cost), by, *words, lambda _: "", at, timed=False)


def _gradient_by(cost: Cost) -> str:
    """Return what declares ∇f; empty: the package takes it by differences."""
    if isinstance(cost, FunctionCost):
        return "" if cost.gradient_function is None else "gradient_function"
    return "" if _inherits(cost, Cost, _GRADIENT_BY) else _by(cost, _GRADIENT_BY)


def _differenced(field: NullSpaceField) -> bool:
    """Return whether the package takes the rate by differences."""
    base = next((each for each in (Cost, VectorField) if isinstance(field, each)), None)
    return base is not None and _inherits(field, base, _RATE_BY)


def _inherits(field: NullSpaceField, base: type, ways: tuple[str, ...]) -> bool:
    """Return whether a field has all these methods, as far as they exist, of a base."""
    return all(
        getattr(type(field), way) is getattr(base, way)
        for way in ways
        if hasattr(base, way)
    )


def _weight_of(field: NullSpaceField, weight: Weight) -> _Declared:
    """Return w and w' of a weight."""

    def at(state: RobotState) -> tuple[Array, Array]:
        w, w_dot = sample_weight(weight, state.read_only)
        return np.array([w], dtype=float), np.array([w_dot], dtype=float)

    by = "" if isinstance(weight, StateWeight) else _by(weight, ("sample",))
    words = "w", "w' = ∂w/∂q·v + ∂w/∂t"
    return _Declared(f"weight of {_named(field)}", by, *words, lambda _: "", at)


def _factors(weight: Weight | float) -> Iterator[Weight]:
    if isinstance(weight, Product):
        yield from _factors(weight.first)
        yield from _factors(weight.second)
    elif isinstance(weight, Weight):
        yield weight


def _named(field: NullSpaceField) -> str:
    return f"{'cost' if isinstance(field, Cost) else 'field'} {field.name!r}"


def _is_own(kind: type) -> bool:
    """Return whether a class is the package's, whose tests prove it."""
    return kind.__module__.partition(".")[0] == "hsp_control"


def _by(part: object, ways: tuple[str, ...]) -> str:
    """Return the name of the method by which somebody's class declares a rate."""
    name = type(part).__name__
    for kind in type(part).__mro__:
        for way in ways:
            if way in vars(kind) and not _is_own(kind):
                return f"{name}.{way}"
    return name


def _check(declared: _Declared, state: RobotState) -> None:
    """Compare a declared rate with the slopes of its value.

    Raises:
        RateError: If they differ, or the value depends on v.
    """
    robot, t, q = state.robot, state.t, state.q.copy()
    random = np.random.default_rng(1)
    signs = random.choice((-1.0, 1.0), (2, robot.nv))
    v, another = signs * random.uniform(0.5, 1.0, (2, robot.nv))  # no joint is slow
    there = RobotState(robot)

    def at(k: int, v_there: Array) -> tuple[Array, Array]:
        s = k * _INTERVAL
        there.update(t + declared.timed * s, robot.integrate(q, s * v), v_there)
        value, rate = declared.at(there)
        return value.copy(), rate.copy()

    first, _ = at(0, v)
    other, _ = at(0, another)
    if _differ(first, other):
        again, _ = at(0, v)
        if _differ(first, again):  # it is random, or remembers: no function of q and t
            return
        i = int(np.abs(first - other).argmax())
        raise RateError(
            f"{declared.part}: {declared.value} depends on v: at t = {t:.6g} s and one "
            f"q, it is {first[i]:.6g}{declared.entry(i)} with one velocity and "
            f"{other[i]:.6g} with another; it may use q, t and frames, but not v. What "
            f"damps self-motion is {spoken('null_space.gain', 'null_space_gain')}"
        )
    if not declared.by:
        return
    samples = [at(k, v) for k in range(5)]
    values, rate = np.array([value for value, _ in samples]), samples[2][1]
    slopes = np.diff(values, axis=0) / _INTERVAL
    slope, spread = slopes.mean(axis=0), slopes.max(axis=0) - slopes.min(axis=0)
    size = float(np.linalg.norm(slope))
    rounding = _ROUNDINGS * _precision(values) * np.linalg.norm(values[2]) / _INTERVAL
    allowed = _ALLOWED * size + _SPREADS * np.linalg.norm(spread) + rounding
    wrong = rate - slope
    if not np.linalg.norm(wrong) > allowed:
        return
    i = int(np.abs(wrong).argmax())
    factor = float(rate @ slope) / size**2 if size > 0.0 else 0.0
    times = ""
    if factor and np.linalg.norm(rate - factor * slope) <= allowed:
        times = f", so that it is {factor:.4g} times what it should be"
    function = declared.by.endswith("_function")
    without = f", or leave {declared.by} out: the package then takes differences"
    raise RateError(
        f"{declared.part}: {declared.by} is wrong: {declared.rate} is {rate[i]:.6g}"
        f"{declared.entry(i)} at t = {t:.6g} s, but a difference of {declared.value} "
        f"gives {slope[i]:.6g}{times}; correct it{without if function else ''}"
    )


def _differ(a: Array, b: Array) -> bool:
    most = max(np.abs(a).max(initial=0.0), np.abs(b).max(initial=0.0))
    return bool((np.abs(a - b) > _SAME * most).any())


def _precision(values: Array) -> float:
    """Return the relative rounding of values, which may be of single precision."""
    single = (values == values.astype(np.float32)).all()
    return float(np.finfo(np.float32 if single else np.float64).eps)
