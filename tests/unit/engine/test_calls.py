"""Kinds, calls and plans of the engine: checks, lifetimes, and construction."""

import copy
import gc
import pickle
import weakref
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from wording import wording

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.edge.threshold import NOT, Thresholds
from hsp_control.engine import Move, Plan, PythonCall
from hsp_control.engine.inspection import calls, first_nan, listing
from hsp_control.trajectories import TrajectorySample


def line(out: TrajectorySample | None = None, **changed: Any) -> Any:
    """Return a call of a line in the plane, with arguments changed."""
    given: dict[str, Any] = {
        "start": np.array([1.0, 2.0]),
        "velocity": np.array([0.5, -1.0]),
        "out": out or sample(),
    }
    return engine.UniformLine(**given | changed)


def sample(**changed: Any) -> TrajectorySample:
    """Return a sample to be written, with arrays changed."""
    return TrajectorySample(np.zeros(2), np.zeros(2), np.ones(2))._replace(**changed)


def test_a_call_reads_its_arrays_anew_each_time() -> None:
    start, out = np.array([1.0, 2.0]), TrajectorySample.allocate(2)
    call = line(out, start=start)
    call(2.0)
    np.testing.assert_array_equal(out.position, [2.0, 0.0])
    np.testing.assert_array_equal(out.velocity, [0.5, -1.0])
    start[:] = 0.0
    call(2.0)
    np.testing.assert_array_equal(out.position, [1.0, -2.0])


def test_a_kind_lists_its_arguments() -> None:
    kind = engine.UniformLine
    assert repr(kind).startswith("UniformLine(start: reads float64 (d,), velocity: ")
    assert kind.timed
    assert kind.reads == ["start", "velocity"]
    assert kind.writes == ["out.position", "out.velocity", "out.acceleration"]
    assert "x0 + t v" in kind.doc
    assert repr(line()) == (
        "UniformLine(start=array(2,), velocity=array(2,), out.position=array(2,), "
        "out.velocity=array(2,), out.acceleration=array(2,))"
    )


class Other(NamedTuple):
    """A record whose names are not those of a sample."""

    position: Array
    speed: Array
    acceleration: Array


def circle(**changed: Any) -> Any:
    """Return a call of a circle in the plane, with arguments changed."""
    given: dict[str, Any] = {"rate": 1.0, "phase": 0.0, "center": np.zeros(2)}
    given |= {"radii": np.eye(2), "out": sample()}
    return engine.Circle(**given | changed)


def threshold_below(**changed: Any) -> Any:
    """Return a call with an integer among its numbers, with arguments changed."""
    given: dict[str, Any] = {"demand": np.zeros(3), "held": 0.0, "above": 1.0}
    given |= {"level": 1, "following": NOT, "thresholds": Thresholds.allocate(2, 2)}
    return engine.ThresholdBelow(**given | changed)


WRONG: dict[str, tuple[Callable[[], Any], str]] = {
    "another size": (
        lambda: line(velocity=np.zeros(3)),
        "UniformLine: velocity ... (3,) ... (d,) ... d = 2",
    ),
    "no array": (lambda: line(start=[0.0, 1.0]), "UniformLine: start ... [0.0, 1.0]"),
    "integers": (
        lambda: line(start=np.zeros(2, dtype=int)),
        "... start ... int64 ... (2,)",
    ),
    "single precision": (
        lambda: line(sample(position=np.zeros(2, dtype=np.float32))),
        "... out.position ... float64 ... float32",
    ),
    "another number of axes": (
        lambda: line(start=np.zeros((2, 1))),
        "... start ... (2, 1)",
    ),
    "not packed": (lambda: line(start=np.zeros(4)[::2]), "... start ... strides (16,)"),
    "reversed": (lambda: line(start=np.zeros(2)[::-1]), "... strides (-8,)"),
    "another byte order": (
        lambda: line(start=np.zeros(2, dtype=">f8")),
        "... start reads float64",
    ),
    "written, but read-only": (
        lambda: line(sample(position=np.broadcast_to(0.0, 2))),
        "... out.position ... read-only",
    ),
    "by order": (
        lambda: engine.UniformLine(np.zeros(2), velocity=np.zeros(2), out=sample()),
        "UniformLine ... by name: ... start",
    ),
    "missing": (
        lambda: engine.UniformLine(start=np.zeros(2)),
        "UniformLine needs velocity, out",
    ),
    "missing in a group": (
        lambda: line(out={"position": np.zeros(2), "velocity": np.zeros(2)}),
        "UniformLine needs out.acceleration",
    ),
    "unknown": (
        lambda: line(velocty=np.zeros(2)),
        "UniformLine ... velocty ... velocity",
    ),
    "unknown, like nothing": (
        lambda: line(gain=np.zeros(2)),
        "UniformLine ... gain ... (start",
    ),
    "unknown in a group": (
        lambda: line(out=Other(*np.zeros((3, 2)))),
        "UniformLine ... out.speed",
    ),
    "given twice": (
        lambda: line(**{"out.position": np.zeros(2)}),
        "UniformLine: out.position ... twice",
    ),
    "no record": (
        lambda: line(out=7),
        "UniformLine: out ... position, velocity, acceleration ... 7",
    ),
    "a record where an array stands": (
        lambda: line(start=Other(1, 2, 3)),  # type: ignore[arg-type]
        "UniformLine: start ... Other(position=1, speed=2,",
    ),
    "no number": (lambda: circle(rate="fast"), "Circle: rate ... number ... 'fast'"),
    "no whole number": (
        lambda: threshold_below(level=0.5),
        "ThresholdBelow: level ... whole number ... 0.5",
    ),
    "no number that an integer holds": (
        lambda: threshold_below(level=np.inf),
        "ThresholdBelow: level ... whole number ... inf",
    ),
    "no plan": (
        lambda: engine.Once(
            calls=line(), stamp=np.zeros(1, dtype=int), made=np.zeros(1, dtype=int)
        ),
        "Once: calls ... a Plan ... UniformLine",
    ),
    "no call": (lambda: Plan([3]), "... `row` ... number 0 is 3"),
}


@pytest.mark.parametrize("case", WRONG)
def test_unsuitable_parts_are_named(case: str) -> None:
    make, message = WRONG[case]
    with pytest.raises((TypeError, ValueError, AttributeError), match=wording(message)):
        make()


def test_an_unknown_kind_is_an_error() -> None:
    with pytest.raises(AttributeError, match="the engine has no kind 'Sirkle'"):
        _ = engine.Sirkle
    assert {"Circle", "Once", "Plan"} <= set(dir(engine))


def test_a_plan_makes_its_calls_in_turn() -> None:
    told: list[float] = []
    first = PythonCall(lambda: told.append(0.0))
    second = PythonCall(told.append, timed=True)
    last = PythonCall(lambda: np.float64(7.0))
    plan = Plan([first, Plan([second, first]), last])
    assert plan(1.5) == 7.0
    assert told == [0.0, 1.5, 0.0]
    assert Plan()(1.0) == 0.0
    assert PythonCall(lambda: 3)() == 3.0
    assert PythonCall(lambda: np.zeros(3))() == 0.0
    assert plan.python
    assert not Plan([line()]).python


def test_python_exceptions_pass_through_a_plan() -> None:
    told: list[int] = []

    def fail() -> None:
        raise KeyboardInterrupt("enough")

    after = PythonCall(lambda: told.append(1))
    stamp = np.ones(1, dtype=int)
    plan = Plan([PythonCall(fail), after])
    once = engine.Once(calls=plan, stamp=stamp, made=0 * stamp)
    with pytest.raises(KeyboardInterrupt, match="enough"):
        Plan([once, after])(0.0)
    assert told == []


def test_calls_are_made_once_at_a_stamp_and_only_if_found() -> None:
    told: list[int] = []
    calls = Plan([PythonCall(lambda: told.append(1) or 4.0)])  # type: ignore[func-returns-value]
    stamp, made = np.zeros((2, 1), dtype=int)
    stamp[0], condition = 3, np.zeros(1, dtype=int)
    once = engine.Once(calls=calls, stamp=stamp, made=made)
    only_if = engine.OnlyIf(calls=calls, condition=condition)
    once()
    once()
    assert (len(told), made[0]) == (1, 3)
    only_if()
    assert len(told) == 1
    condition[0] = 1
    only_if()
    assert len(told) == 2


def test_a_group_is_a_record_or_given_member_by_member() -> None:
    out = sample()
    call = line(out)
    by_member = {f"out.{name}": array for name, array in out._asdict().items()}
    assert call.values.keys() == {"start", "velocity", *by_member}
    for same in (line(out=out._asdict()), call.kind(**call.values)):
        assert all(same.values[name] is array for name, array in by_member.items())


def test_the_description_of_a_call_is_a_copy() -> None:
    call = line()
    call.values.clear()
    assert call.values["start"][0] == 1.0


@pytest.mark.parametrize(
    "how", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_copies_have_independent_memory(how: Callable[[Any], Any]) -> None:
    out = TrajectorySample.allocate(2)
    plan, copied = how((Plan([line(out)]), out))
    plan(2.0)
    np.testing.assert_array_equal(copied.position, [2.0, 0.0])
    assert not out.position.any()


def test_a_call_keeps_its_arrays_and_lets_them_go() -> None:
    position = np.zeros(2)
    watched = weakref.ref(position)
    plan = Plan([line(sample(position=position))])
    del position
    gc.collect()
    plan(1.0)
    assert watched() is not None
    del plan
    gc.collect()
    assert watched() is None


def test_a_function_that_leads_back_to_its_plan_is_collected() -> None:
    class Owner:
        def __init__(self) -> None:
            self.plan = Plan([PythonCall(self.told)])

        def told(self) -> None:
            pass

    owner = Owner()
    watched = weakref.ref(owner)
    owner.plan()
    del owner
    gc.collect()
    assert watched() is None


def moving(told: list[float], blocks: Any = ()) -> tuple[Move, list[Array]]:
    """Return a move of 3 coordinates and 2 velocities, and its memory."""
    memory = [np.zeros(1), np.zeros(3), np.zeros(2)]
    unit = np.array(blocks, dtype=int).reshape(-1, 2)
    plan = Plan([PythonCall(told.append, timed=True), PythonCall(lambda: -1.0)])
    time, q, v = memory
    stamp = np.zeros(1, dtype=int)
    numbers = {"origin": np.zeros(1), "time": time, "q": q, "v": v}
    move = Move(calls=plan, **numbers, unit_blocks=unit, stamp=stamp)
    return move, memory


def test_a_move_copies_valid_input_and_makes_its_calls() -> None:
    told: list[float] = []
    move, (t, q, v) = moving(told)
    assert move(0.5, np.arange(6.0)[::2], np.ones(2)) == -1.0
    np.testing.assert_array_equal(np.concatenate([t, q, v]), [0.5, 0, 2, 4, 1, 1])
    assert told == [0.5]


@pytest.mark.parametrize(
    ("t", "q", "v"),
    [
        (np.nan, np.zeros(3), np.zeros(2)),
        (0.0, np.array([0.0, np.inf, 0.0]), np.zeros(2)),
        (0.0, np.zeros(3), np.array([np.nan, 0.0])),
        (0.0, np.zeros(2), np.zeros(2)),
        (0.0, np.zeros(3), np.zeros((2, 1))),
        (0.0, np.zeros(3, dtype=int), np.zeros(2)),
        (0.0, [0.0, 0.0, 0.0], np.zeros(2)),
        (0.0, np.zeros(3, dtype=">f8"), np.zeros(2)),
    ],
)
def test_a_move_refuses_invalid_input(t: float, q: Any, v: Any) -> None:
    told: list[float] = []
    move, memory = moving(told)
    assert move(t, q, v) is None
    assert told == []
    assert not np.concatenate(memory).any()


def test_a_move_refuses_directions_that_are_not_of_norm_1() -> None:
    move, _ = moving([], blocks=[[0, 2]])
    assert move(0.0, np.array([0.6, 0.8, 9.0]), np.zeros(2)) == -1.0
    assert move(0.0, np.array([0.6, 0.9, 9.0]), np.zeros(2)) is None


def test_equal_steps_divide_an_interval() -> None:
    told: list[float] = []
    now, h = np.zeros((2, 1))
    steps = engine.EqualSteps(
        calls=Plan([PythonCall(told.append, timed=True)]),
        interval=np.array([1.0, 1.3]),
        longest=0.11,
        now=now,
        h=h,
    )
    steps()
    np.testing.assert_allclose(told, [1.0, 1.1, 1.2], rtol=1e-15)
    assert h[0] == pytest.approx(0.1)


def test_a_plan_lists_its_calls_and_their_outputs() -> None:
    out = TrajectorySample.allocate(2)
    second = line(start=out.position)
    plan = Plan([line(out), PythonCall(print), Plan([second])])
    assert [*calls(plan)][-1] is second
    text = listing(plan)
    assert "  0 UniformLine\n      <- start [2]\n" in text
    assert "      -> out.position [2]" in text
    assert "  2 UniformLine\n      <- start [2], from 0\n" in text
    assert repr(plan).count("\n") > 2


def test_the_first_call_that_writes_nan_is_found() -> None:
    out = TrajectorySample.allocate(2)
    wrong = line(out, velocity=np.array([0.0, np.nan]))
    stamp = np.zeros(1, dtype=int)
    inner = Plan([line(), wrong])
    once = engine.Once(calls=inner, stamp=stamp, made=stamp - 1)
    assert first_nan(Plan([line(), once, line(start=out.position)])) == (
        wrong,
        ["out.position", "out.velocity"],
    )
    assert first_nan(Plan([line()])) is None
