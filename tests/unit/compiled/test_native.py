"""Calls that are packed once: the same as calling the kernels, in order, on time."""

import copy
import gc
import weakref
from functools import partial

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.compiled import adapters
from hsp_control.compiled.kernels import PLAIN, TIME, KernelCall, Once, OnlyIf, kernel
from hsp_control.compiled.linalg import multiply
from hsp_control.compiled.linked_kernels import _LINEAR_ALGEBRA
from hsp_control.compiled.native import NativeCall
from hsp_control.compiled.step_plan import bind, planned
from hsp_control.engine import Plan

EPS = float(np.finfo(float).eps)

compiled = pytest.mark.skipif(
    not hasattr(kernel(lambda: None), "py_func"), reason="NUMBA_DISABLE_JIT is set"
)


@kernel
def _note(log: Array, who: float) -> float:
    """Write who was called at the next place, which log[0] counts; return who."""
    log[0] += 1.0
    log[int(log[0])] = who
    return who


@kernel
def _note_time(log: Array, who: float, t: float) -> None:
    log[0] += 1.0
    log[int(log[0])] = who + t


@kernel
def _combine(
    flag: bool, count: int, factor: float, A: Array, x: Array, places: Array, out: Array
) -> bool:
    """Write A x, scaled where flagged, and place by place."""
    for i in range(A.shape[0]):
        total = 0.0
        for j in range(A.shape[1]):
            total += A[i, j] * x[j]
        out[places[i]] = factor * total if flag else total + count
    return flag


def called(log: Array) -> list[float]:
    """Return who was called, and forget it."""
    names = log[1 : 1 + int(log[0])].tolist()
    log[:] = 0.0
    return names


@pytest.mark.parametrize("layout", ["C", "F", "strided", "reversed", "read-only"])
@settings(max_examples=20, deadline=None)
@given(
    flag=st.booleans(),
    count=st.integers(-5, 5),
    rows=st.integers(1, 5),
    columns=st.integers(0, 40),
    seed=st.integers(0, 99),
)
def test_a_bound_call_is_the_kernel(
    layout: str, flag: bool, count: int, rows: int, columns: int, seed: int
) -> None:
    """To the rounding of sums in another order: the two are compiled one by one.

    How many products a processor adds at once depends on it, and on what is known of
    the arrays, so that the last bits are anybody's.
    """
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((rows, columns))
    if layout == "F":
        A = np.asfortranarray(A)
    elif layout == "strided":
        A = rng.standard_normal((2 * rows, 3 * columns))[::2, 1::3]
    elif layout == "reversed":
        A = A[::-1]
    elif layout == "read-only":
        A.flags.writeable = False
    x, places = rng.standard_normal(columns), rng.permutation(rows)
    direct, bound = np.zeros((2, rows))
    arguments = flag, count, 0.7, A, x, places
    call = bind(_combine, *arguments, bound)
    assert bool(call()) == _combine(*arguments, direct) == flag
    for _ in range(2):
        # Each of the two is at most n eps of the sum of sizes beside the exact sum.
        rounding = np.zeros(rows)
        rounding[places] = 2.0 * (columns + 2) * EPS * (np.abs(A) @ np.abs(x) + 5.0)
        assert np.all(np.abs(bound - direct) <= rounding)
        x[:] = rng.standard_normal(columns)  # arrays are followed
        call()
        _combine(*arguments, direct)


@pytest.mark.slow
@compiled
def test_a_call_keeps_its_arrays_alive_and_lets_them_go() -> None:
    log = np.zeros(4)
    watched = weakref.ref(log)
    call = Plan([bind(_note, log, 3.0)])
    del log
    gc.collect()
    for _ in range(3):
        assert call(0.0) == 3.0
    assert watched() is not None
    del call
    gc.collect()
    assert watched() is None


@compiled
def test_calls_are_made_in_turn() -> None:
    log = np.zeros(9)
    first, last = bind(_note, log, 1.0), bind(_note, log, 2.0)
    timed = bind(_note_time, log, 10.0, timed=True)
    call = Plan([timed, Plan([last, first]), last])
    assert call(1.5) == 2.0
    assert called(log) == [11.5, 2.0, 1.0, 2.0]


def test_steps_are_references_then_what_reads_them_then_the_law() -> None:
    """Whatever is compiled, and whatever is somebody's own Python."""
    log = np.zeros(20)

    def own(t: float) -> None:
        _note(log, 100.0 + t)

    def own_write() -> None:
        _note(log, 7.0)

    pair = planned([(_note, (log, 2.0)), (_note, (log, 3.0))]).call()
    calls = [
        (_note, (log, 1.0)), (own_write, ()), (_note_time, (log, 20.0, TIME)),
        (own, (TIME,)), (pair, ()), (_note, (log, 4.0)),
    ]  # fmt: skip
    plan = planned(calls)
    assert Plan(plan.steps())(0.5) == plan.run(0.5) == 4.0
    assert called(log) == 2 * [20.5, 100.5, 1.0, 7.0, 2.0, 3.0, 4.0]


def two_notes(log: Array, *, plain: bool) -> list[KernelCall]:
    """Return calls, of which the second is in Python if ``plain``."""
    last = (partial(_note, log, 2.0), ()) if plain else (_note, (log, 2.0))
    return [(_note, (log, 1.0)), last]


@pytest.mark.parametrize("plain", [False, True])
def test_calls_are_made_once_at_a_stamp(plain: bool) -> None:
    """Also by a copy, which counts the stamps of its own array."""
    log, stamp = np.zeros(20), np.zeros(1, dtype=np.int64)
    call = planned([Once.at(stamp, *two_notes(log, plain=plain))]).call()
    assert call.python == (plain or PLAIN)
    gc.collect()  # nothing that the call points to may be gone
    for value in (3, 3, 0, 4):
        stamp[0] = value
        call()
        call()
    assert called(log) == [1.0, 2.0] * 3
    copied, own, own_stamp = copy.deepcopy((call, log, stamp))
    own_stamp[0] = 5
    copied()
    copied()
    assert called(own) == [1.0, 2.0]
    assert called(log) == []


@pytest.mark.parametrize("plain", [False, True])
def test_calls_are_made_only_if_something_was_found(plain: bool) -> None:
    """Also by a copy, which looks at its own array."""
    log, found = np.zeros(20), np.array([16.0, 0.0])
    call = planned([OnlyIf(two_notes(log, plain=plain), found)]).call()
    assert call.python == (plain or PLAIN)
    gc.collect()  # nothing that the call points to may be gone
    assert call() == 16.0
    assert called(log) == []
    found[:] = 4.0, 1.0
    assert call() == 6.0
    assert called(log) == [1.0, 2.0]
    copied, own, own_found = copy.deepcopy((call, log, found))
    own_found[1] = 0.0
    assert copied() == 4.0
    own_found[1] = 3.0
    assert copied() == 6.0
    assert called(own) == [1.0, 2.0]
    assert called(log) == []


@compiled
def test_linear_algebra_is_known_in_machine_code() -> None:
    """Else each caller has a copy of it, and a first start takes 5 % longer."""
    multiply(np.eye(2), np.ones(2), np.zeros(2))
    (made, *_) = multiply.overloads.values()  # type: ignore[attr-defined]
    assert _LINEAR_ALGEBRA in made.fndesc.mangled_name


@compiled
def test_numba_s_layout_is_known() -> None:
    assert adapters.unknown_layout() == ""
    assert adapters.AVAILABLE


def test_another_layout_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(adapters, "_ARRAY", ("data", "shape"))
    with pytest.warns(RuntimeWarning, match="an array is meminfo, .*; known is data, "):
        assert not adapters._available()


def test_ordinary_calls_give_the_same_efforts(monkeypatch: pytest.MonkeyPatch) -> None:
    """As with a Numba whose layout is not known: slower, but right."""

    def effort() -> Array:
        robot = hsp.Robot.load("panda")
        hold = hsp.Hold([0.4, 0.1, 0.5])
        task = hsp.FramePosition("panda_tcp", hold, gains=hsp.Gains(25.0, 10.0))
        field = hsp.JointCentering() + hsp.Manipulability("panda_tcp")
        controller = hsp.Controller(robot, [task], field, limits=hsp.Limits())
        state = robot.state(0.2, robot.home(), np.linspace(-0.5, 0.5, 7))
        return np.array(controller.compute(state).tau)

    packed = effort()
    monkeypatch.setattr(adapters, "AVAILABLE", False)
    assert not isinstance(bind(_note, np.zeros(2), 1.0), NativeCall)
    # Kernels that are not compiled into one another add their sums in another order.
    np.testing.assert_allclose(effort(), packed, rtol=1e-12, atol=1e-11)
