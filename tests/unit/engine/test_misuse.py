"""Misuse of the engine from Python is refused or harmless, never a memory error.

Calls that may end a process run in another one.
"""

import gc
import os
import re
import subprocess
import sys
import textwrap
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from places import THOROUGH
from wording import wording

from hsp_control import engine
from hsp_control.engine import Dynamics, Move, Plan, PythonCall
from hsp_control.engine._engine import kinds

FIELD = re.compile(
    r"([\w.]+)(?:: (a \w+|\w+ (float64|int64|bool) \(([^)]*)\)(, column by column)?))?"
    r"(?:, |$)"
)


def joint(**changed: Any) -> SimpleNamespace:
    """Return the numbers of a joint, with some of them changed."""
    given: dict[str, Any] = {
        "name": "a", "type": "JointModelRX", "parent": 0,
        "placement": (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
        "axis": (1.0, 0.0, 0.0), "pitch": 0.0, "leader": 0, "ratio": 1.0, "offset": 0.0,
        "parts": (), "mass": 1.0, "center": (0.0, 0.0, 0.1),
        "inertia": (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0),
    }  # fmt: skip
    return SimpleNamespace(**given | changed)


def chain(
    *joints: SimpleNamespace, armature: tuple[Any, ...] | None = None
) -> Dynamics:
    """Return the dynamics of joints with one degree of freedom each."""
    rotors = (0.0,) * len(joints) if armature is None else armature
    return Dynamics(joints, (0.0, 0.0, -9.81), rotors)


def moving(n: int, **changed: Any) -> Move:
    """Return a move of n coordinates, with arguments changed."""
    given: dict[str, Any] = {"calls": Plan(), "time": np.zeros(1), "q": np.zeros(n)}
    given["origin"] = np.zeros(1)
    given |= {"v": np.zeros(n), "unit_blocks": np.zeros((0, 2), dtype=int)}
    return Move(**given | {"stamp": np.zeros(1, dtype=int)} | changed)


def odd_arguments(kind: engine.Kind, seed: int) -> dict[str, Any]:
    """Return arguments of a kind: small sizes, and numbers and indices at random.

    One time in three all indices are 0, which often is one, and the call is made.
    """
    rng = np.random.default_rng(seed)
    sizes: dict[str, int] = {}
    same, uniform = int(rng.integers(0, 5)), rng.random() < 0.5

    def size(text: str) -> int:
        drawn = same if uniform else int(rng.integers(0, 6))
        return int(text) if text.isdigit() else sizes.setdefault(text, drawn)

    found: dict[str, Any] = {}
    objects: dict[str, str] = {}
    # Pinocchio's assertions fail for numbers that are not finite: in a build with them,
    # its calls get ordinary ones.
    odd = not ("HSP_ENGINE" in os.environ and "a Dynamics" in repr(kind))
    for name, use, entry, shape, columns in FIELD.findall(
        repr(kind).removeprefix(f"{kind.name}(").removesuffix(")")
    ):
        if not name:
            continue
        if use.startswith("a "):
            objects[name] = use.removeprefix("a ")
        elif not use:
            found[name] = int(rng.choice([0, 1, 2, 3, -1, 10**9]))
        else:
            given = tuple(size(each.strip()) for each in shape.split(",") if each)
            if entry == "float64":
                scale = rng.choice(
                    [0.0, 1.0, 1e300, np.nan], p=[0.15, 0.75, 0.05, 0.05]
                )
                scale = scale if odd else 1.0
                array = scale * rng.normal(size=given)
                found[name] = np.asfortranarray(array) if columns else array
            elif entry == "int64":
                least, most = [(0, 1), (0, 3), (-3, 6)][seed % 3]
                indices = rng.integers(least, most, size=given)
                found[name] = np.sort(indices, axis=0) if seed % 2 else indices
            else:
                found[name] = rng.random(size=given) < 0.5
    n = sizes.get("n", 0)
    made: dict[str, Callable[[], Any]] = {
        "Plan": Plan,
        "Move": lambda: moving(n),
        "Dynamics": lambda: chain(*(joint(name=str(k), parent=k) for k in range(n))),
    }
    return found | {name: made[what]() for name, what in objects.items()}


def try_kinds(trace: Path, rounds: int) -> None:
    """Make and run calls of all kinds with odd arguments; print each before it."""
    done = 0
    for kind in kinds:
        if kind.name in ("EqualSteps", "Periods"):
            continue  # their arguments determine how often they repeat
        for seed in range(rounds):
            trace.write_text(f"{kind.name} with the seed {seed}")
            try:
                call = kind(**odd_arguments(kind, seed))
                done += 1
                call(0.3)
                call(0.7)
            except ValueError:
                pass
    assert done > rounds
    trace.write_text("all")


def alone(
    code: str, *arguments: str, flags: tuple[str, ...] = ()
) -> subprocess.CompletedProcess[str]:
    """Run a program in another process, with this file's definitions."""
    folders = [
        str(Path(__file__).parent),
        str(Path(wording.__code__.co_filename).parent),
    ]
    here = f"import sys; sys.path[:0] = {folders!r}\n"
    return subprocess.run(
        [sys.executable, *flags, "-c", here + textwrap.dedent(code), *arguments],
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.mark.process
def test_no_sizes_and_no_indices_reach_memory_of_something_else(tmp_path: Path) -> None:
    """With Eigen's assertions every wrong index ends the process; without, many do."""
    trace = tmp_path / "trace"
    ran = alone(
        """
        from pathlib import Path
        from test_misuse import try_kinds
        try_kinds(Path(sys.argv[1]), int(sys.argv[2]))
        """,
        str(trace),
        "60" if THOROUGH else "20",
    )
    assert (ran.returncode, trace.read_text()) == (0, "all"), ran.stderr[-2000:]


def indices(*numbers: int) -> Any:
    return np.array(numbers, dtype=int)


def track(axes: Any) -> Any:
    """Return a call that tracks a point along two axes."""
    n, m = 3, 2
    point: dict[str, Any] = {
        "jacobian": np.zeros((3, n)),
        "jacobian_dot": np.zeros((3, n)),
    }
    motion = ("position", "velocity", "own_acceleration")
    point |= {name: np.zeros(3) for name in motion}
    desired: dict[str, Any] = {"position": np.zeros(m), "velocity": np.zeros(m)}
    return engine.TrackAxes(
        axes=axes,
        point=point,
        desired=desired | {"acceleration": np.zeros(m)},
        feedback={
            "Kp": np.eye(m), "Kv": np.eye(m), "offset": np.zeros(m),
            "largest": np.zeros((0, 3)),
        },
        out={
            "jacobian": np.zeros((m, n)), "jacobian_dot": np.zeros((m, n)),
            "error": np.zeros(m), "error_rate": np.zeros(m),
            "acceleration": np.zeros(m),
        },
    )  # fmt: skip


def centering(limited: Any) -> Any:
    """Return a call of the cost of two joints."""
    k, n = np.zeros(2), np.zeros(4)
    return engine.JointCentering(
        q=n,
        v=n,
        limited=limited,
        middle=k,
        stiffness=k,
        gradient=n.copy(),
        rate=n.copy(),
    )


def of_follower(**changed: Any) -> Any:
    """Return the dynamics of a joint and of one that follows it, changed."""
    follower = joint(name="b", parent=1, leader=1)
    return chain(joint(**changed), follower, armature=(0.0,))


def nested(depth: int) -> Plan:
    """Return plans one within another."""
    plan = Plan()
    for _ in range(depth):
        plan = Plan([plan])
    return plan


def itself() -> SimpleNamespace:
    """Return a composite joint that is a part of itself."""
    whole = joint(type="JointModelComposite")
    whole.parts = (whole,)
    return whole


def every(longest: float, end: float = 1.0) -> Any:
    """Return steps of an interval that begins at 0."""
    return engine.EqualSteps(
        calls=Plan(), interval=np.array([0.0, end]), longest=longest,
        now=np.zeros(1), h=np.zeros(1),
    )  # fmt: skip


REFUSED: dict[str, tuple[Callable[[], Any], str]] = {
    "an axis that no point has": (
        lambda: track(indices(0, 3)),
        "TrackAxes: axes ... 3 ... 0 to 2",
    ),
    "an axis below zero": (lambda: track(indices(-1, 0)), "... axes ... -1 ... 0"),
    "a joint that no robot has": (
        lambda: centering(np.array([[0, 0], [3, 4]])),
        "JointCentering: ... 4 ... 0 to 3",
    ),
    "memory that is read and written": (
        lambda: engine.Copy(x=(both := np.zeros(3)), out=both),
        "Copy: out ... memory of x",
    ),
    "memory that is partly written": (
        lambda: engine.Copy(x=(both := np.zeros(4))[:3], out=both[1:]),
        "Copy: out ... memory of x",
    ),
    "a block beyond q": (
        lambda: moving(4, unit_blocks=np.array([[2, 3]])),
        "... unit_blocks ... 3 ... 0 to 2",
    ),
    "steps of no length": (lambda: every(0.0), "EqualSteps: longest ... more than 0"),
    "endless steps": (lambda: every(0.1, np.inf)(), "EqualSteps: ... 1e9 steps"),
    "too many steps": (lambda: every(1e-300)(), "EqualSteps: ... 1e9 steps"),
    "plans without end": (lambda: nested(1001), "... 1000 plans"),
    "None in a plan": (lambda: Plan([None]), "... number 0 is None"),
    "no address": (
        lambda: Plan([PythonCall(print), SimpleNamespace(row=(0, 0))]),
        "... `row` ... number 1 is namespace(row=(0, 0))",
    ),
    "a joint of no type": (lambda: chain(joint(type="")), "... 'a' is a , ... engine"),
    "no parts": (
        lambda: chain(joint(type="JointModelComposite")),
        "... 'a' is a composite without parts",
    ),
    "a part of itself": (lambda: chain(itself()), "... composites ... 100"),
    "too few numbers": (
        lambda: chain(joint(center=(1.0,))),
        "joint 'a': center ... 3 ... (1.0,)",
    ),
    "half a joint": (lambda: chain(joint(parent=0.5)), "... parent ... whole number"),
    "no mass": (lambda: chain(joint(mass=np.nan)), "... 'a': ... mass ... 0 or more"),
    "less than no mass": (lambda: chain(joint(mass=-1.0)), "... mass ... 0 or more"),
    "no axis": (lambda: chain(joint(axis=(0.0,) * 3)), "... axis ... norm 1"),
    "no inertia": (
        lambda: chain(joint(inertia=(np.nan,) * 9)),
        "... inertia ... finite",
    ),
    "half an inertia": (
        lambda: chain(joint(inertia=(1.0, 0.5, 0.0, 0.4, 1.0, 0.0, 0.0, 0.0, 1.0))),
        "... 'a': ... inertia ... not symmetric",
    ),
    "no armature": (
        lambda: chain(joint(), armature=("x",)),
        "... armature is numbers",
    ),
    "infinite rotors": (lambda: chain(joint(), armature=(np.inf,)), "... not finite"),
    "a leader of two coordinates": (
        lambda: of_follower(type="JointModelRevoluteUnbounded"),
        "... joint 'b' cannot follow",
    ),
    "no object": (
        lambda: engine.MassMatrix(
            dynamics=Dynamics.__new__(Dynamics), q=np.zeros(1), M=np.zeros((1, 1))
        ),
        "MassMatrix: dynamics is a Dynamics; got <",
    ),
    "half a character": (
        lambda: engine.Copy(**{"\udc80": 1}),
        r"... argument \udc80",
    ),
    "a number beyond all": (lambda: PythonCall(lambda: 10**400)(), "int too large"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_misuse_is_refused_with_its_reason(case: str) -> None:
    make, message = REFUSED[case]
    with pytest.raises((TypeError, ValueError, OverflowError), match=wording(message)):
        make()


def test_arrays_side_by_side_are_apart() -> None:
    both = np.arange(6.0)
    engine.Copy(x=both[:3], out=both[3:])()
    np.testing.assert_array_equal(both, [0, 1, 2, 0, 1, 2])
    nothing = np.zeros(0)
    engine.Copy(x=nothing, out=nothing)()


def test_plans_as_deep_as_they_may_be_are_run() -> None:
    assert nested(999)() == 0.0


@pytest.mark.parametrize(
    "value", [np.str_("a"), np.datetime64("2020-01-01"), np.complex128(1j), "a", None]
)
def test_nan_is_ignored(value: object) -> None:
    assert PythonCall(lambda: value)() == 0.0


@pytest.mark.parametrize("value", [2, 2.0, np.float32(2), np.int8(2), np.array(2.0)])
def test_a_number_of_numpy_counts(value: object) -> None:
    assert PythonCall(lambda: value)() == 2.0


class Interrupted:
    """A time that is interrupted where it is read."""

    def __float__(self) -> float:
        raise KeyboardInterrupt


def test_an_interrupt_is_no_refusal() -> None:
    with pytest.raises(KeyboardInterrupt):
        moving(1)(Interrupted(), np.zeros(1), np.zeros(1))  # type: ignore[arg-type]
    assert moving(1)("now", np.zeros(1), np.zeros(1)) is None  # type: ignore[arg-type]


def test_a_plan_may_let_itself_go_while_it_runs() -> None:
    held: dict[str, Plan] = {}
    last = PythonCall(lambda: 2.0)
    held["plan"] = Plan([PythonCall(held.clear), PythonCall(gc.collect), last])
    assert held["plan"]() == 2.0
    assert not held


def test_a_plan_that_makes_itself_ends_as_a_recursion_of_python_does() -> None:
    held: list[Plan] = []
    held.append(Plan([PythonCall(lambda: held[0]())]))
    with pytest.raises(RecursionError):
        held[0]()


def test_a_barrier_does_not_write_beyond_its_rows() -> None:
    one = np.ones(1)
    rows = {"number": indices(1), "A": np.zeros((1, 1)), "least": np.zeros(1)}
    call = engine.HoldingRows(
        share=0.1, bandwidth=1.0, look_ahead=0.0, near=0.1, motors=indices(0),
        limit=one, effort=one, slope=np.eye(1), drift=one, v=one, rows=rows,
    )  # fmt: skip
    with pytest.raises(ValueError, match="more rows than are reserved"):
        call()
    rows["number"][0] = 0
    call()
    assert rows["number"][0] == 1


@pytest.mark.process
@pytest.mark.parametrize("flags", [(), ("-X", "dev"), ("-OO",)])
def test_an_interpreter_ends_with_live_plans(flags: tuple[str, ...]) -> None:
    code = """
        from test_misuse import Plan, PythonCall, indices, track
        kept = []
        kept.append(Plan([track(indices(0, 1)), PythonCall(lambda: len(kept))]))
        print(kept[0]())
    """
    ran = alone(code, flags=flags)
    assert (ran.returncode, ran.stdout) == (0, "1.0\n"), ran.stderr
