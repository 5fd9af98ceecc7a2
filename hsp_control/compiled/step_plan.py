"""A step's plan: the calls of parts, bound once, native ones as one.

A part says its mathematics as a kernel with its arguments, a `KernelCall`. An argument
may be something that has to be brought up to date first: the kinematics of a frame, a
trajectory, what another kernel writes. Its method ``supplied`` returns what the kernel
reads, and the calls that write it. `planned` makes a plan of it all.
"""

from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby, takewhile
from typing import Any, NamedTuple

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled import moves
from hsp_control.compiled.kernels import (
    PLAIN,
    TIME,
    AnyCall,
    KernelCalls,
    KernelOutput,
    Once,
    OnlyIf,
    is_compiled,
    with_outputs,
)
from hsp_control.compiled.native import NativeCall, are_native, sequence
from hsp_control.compiled.pinocchio_calls import bind_pinocchio, is_pinocchio
from hsp_control.engine import Call, Kind


class StepPlan(NamedTuple):
    """The calls that evaluate parts of a controller, at whatever the state is."""

    # calls of the time [s] that update references
    follow: tuple[Callable[[float], object], ...] = ()
    # calls without arguments that read the state and write the results
    write: tuple[Callable[[], Any], ...] = ()

    def run(self, t: float) -> Any:
        """Make the calls at a time [s]; return what the last one returns."""
        value = None
        for follow in self.follow:
            follow(t)
        for write in self.write:
            value = write()
        return value

    def steps(self) -> list[Callable[[float], Any]]:
        """Return the same calls, all of the time: native ones in a row as one."""
        parts = [*self.follow, *map(_whenever, self.write)]
        found: list[Callable[[float], Any]] = []
        for _, group in groupby(parts, lambda part: isinstance(part, NativeCall)):
            calls = [*group]
            found += [sequence(calls)] if are_native(calls) else calls
        return found

    def call(self) -> Callable[[], Any]:
        """Return what writes, as one call."""
        if len(self.write) == 1:
            return self.write[0]
        if are_native(self.write):
            return sequence(self.write, 0.0)
        return partial(StepPlan(write=self.write).run, 0.0)


def planned(calls: KernelCalls) -> StepPlan:
    """Return the plan of calls; one that comes twice is bound once."""
    plans: dict[int, StepPlan] = {}
    follow: list[Callable[[float], object]] = []
    write: list[Callable[[], Any]] = []
    for each in calls:
        if id(each) not in plans:
            plans[id(each)] = _plan(each)
            follow += plans[id(each)].follow
        write += plans[id(each)].write
    return StepPlan(tuple(follow), tuple(write))


def _plan(call: AnyCall) -> StepPlan:
    """Return the plan of one call."""
    if isinstance(call, Once | OnlyIf):
        follow, write = planned(call.calls)
        return StepPlan(follow, (_among(write, call),))
    function, arguments = call
    timed = bool(arguments) and arguments[-1] is TIME
    given, (follow, write) = supplied(arguments[:-1] if timed else arguments)
    own = bind(function, *given, timed=timed)
    if timed:
        return StepPlan((*follow, own), write)
    return StepPlan(follow, (*write, own))


def supplied(argument: Any) -> tuple[Any, StepPlan]:
    """Return an argument as a kernel reads it, and the plan of what writes it."""
    if type(argument) is KernelOutput:
        return argument.out, planned([with_outputs(*argument)])
    if hasattr(argument, "supplied"):
        value, calls = argument.supplied()
        return value, planned(calls)
    if type(argument) is not tuple:
        return argument, StepPlan()
    parts = [supplied(each) for each in argument]
    follow = tuple(call for _, plan in parts for call in plan.follow)
    write = tuple(call for _, plan in parts for call in plan.write)
    return tuple(value for value, _ in parts), StepPlan(follow, write)


def bind(
    function: Callable[..., Any], *arguments: Any, timed: bool = False
) -> Callable[..., Any]:
    """Return a call of a kernel, or of another function, with these arguments.

    Args:
        function: The kernel, which returns nothing or one number; or a function of
            Pinocchio, see `pinocchio_calls`.
        arguments: Arrays, numbers, and tuples or records of them. The call reads and
            writes the memory of these arrays each time; numbers are constants.
        timed: Whether the kernel has one more argument, the time, given to the call.
    """
    if isinstance(function, Kind):
        return engine_call(function(*arguments))
    if not arguments and not is_compiled(function):
        return function
    if is_pinocchio(function):
        return bind_pinocchio(function.__name__, *arguments)
    if is_compiled(function):
        from hsp_control.compiled import adapters  # here: plain runs need no Numba

        if adapters.AVAILABLE:
            return NativeCall.of(function, arguments, timed)
    return partial(function, *arguments)


def engine_call(call: Call) -> Callable[..., Any]:
    """Return a call of the engine as one that stands in a row with compiled kernels."""
    if PLAIN:
        return call
    from hsp_control.compiled import adapters

    return NativeCall.of_engine(call) if adapters.AVAILABLE else call


def moving(memory: moves.Memory, calls: Sequence[Callable[[float], Any]]) -> moves.Move:
    """Return the move of a memory, with calls of the time that follow."""
    native = [*takewhile(lambda call: isinstance(call, NativeCall), calls)]
    rest = calls[len(native) :]
    move: moves.Move = partial(moves.move, memory)
    if native and are_native(native):
        from hsp_control.compiled.native_move import NativeMove

        move = NativeMove.of(native, memory)
    return partial(moves.move_and_call, move, rest) if rest else move


def in_equal_steps(
    calls: Sequence[Callable[[float], Any]],
    interval: Array,
    longest: float,
    now: Array,
    h: Array,
) -> Callable[[], object]:
    """Return a call that divides an interval, and makes the calls of each step.

    Args:
        calls: The calls of a step, of the time at its beginning [s].
        interval: Beginning and end [s], shape (2,).
        longest: The longest step [s].
        now: Where that time is written, shape (1,).
        h: Where the steps' length is written [s], shape (1,).
    """
    if not are_native(calls):
        return partial(moves.make_steps, calls, interval, longest, now, h)
    from hsp_control.compiled.native_move import make_steps

    return NativeCall.over(make_steps, calls, interval, longest, now, h)


def _among(
    calls: Sequence[Callable[[], Any]], asked: Once | OnlyIf
) -> Callable[[], Any]:
    """Return one call that makes several, or does not."""
    once, (_, *arguments) = isinstance(asked, Once), asked
    if not are_native(calls):
        return partial(_make_once if once else _make_if, calls, *arguments)
    from hsp_control.compiled.adapters import run_if, run_once

    return NativeCall.over(run_once if once else run_if, calls, *arguments)


def _make_once(
    calls: Sequence[Callable[[], object]], stamp: Indices, made: Indices
) -> None:
    """Do what `adapters.run_once` does, where calls are made one by one."""
    if made[0] != stamp[0]:
        made[0] = stamp[0]
        for call in calls:
            call()


def _make_if(calls: Sequence[Callable[[], float]], found: Array) -> float:
    """Do what `adapters.run_if` does, where calls are made one by one."""
    value, last = float(found[0]), 0.0
    if found[1] != 0.0:
        for call in calls:
            last = call()
    return value + last


def _whenever(call: Callable[[], Any]) -> Callable[[float], Any]:
    return call if isinstance(call, NativeCall) else lambda t: call()
