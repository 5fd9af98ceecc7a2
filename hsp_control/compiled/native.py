"""Native calls: kernels with their arguments, run without Python in between.

From Python, each array argument costs 6 ns, the entry into compiled code 50 ns, and one
step of a loop 60 ns. For a kernel of 0.1 µs with ten arrays that is more than its work.
`bind` packs the arguments once into words of memory, and compiles an adapter that reads
them there. All adapters have one signature, whatever the kernel's, so that `run` can
call them by their addresses.

A part says its mathematics as a kernel with its arguments, a `KernelCall`. An argument
may be something that has to be brought up to date first: the kinematics of a frame, a
trajectory, what another kernel writes. Its method ``supplied`` returns what the kernel
reads, and the calls that write it: those of the time, and those that read the state.
`planned` makes a step plan of it all: the calls of a step, decided once.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import groupby
from typing import Any, NamedTuple, Self, TypeGuard

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import (
    KernelCalls,
    KernelOutput,
    is_compiled,
    with_outputs,
)


class NativeCall(partial[float]):
    """A kernel with its arguments: a call without arguments, or of the time.

    It is a `partial` because Python calls nothing faster.

    Attributes:
        words: The packed arguments.
        kept: What the arguments point to besides, if anything.
        recipe: A function and its arguments that make this call. It keeps the arrays
            alive, and copies and pickles use it to bind the copied arrays.
    """

    words: Indices
    recipe: tuple[Callable[..., Any], tuple[Any, ...]]
    kept: object

    @classmethod
    def of(
        cls, kernel: Callable[..., Any], arguments: tuple[Any, ...], timed: bool
    ) -> Self:
        """Pack the arguments, and compile or load the adapter."""
        from hsp_control.compiled import adapters

        kinds, words = adapters.packed(arguments)
        address = adapters.adapter(kernel, kinds, timed)
        row = address, words.ctypes.data
        free = () if timed else (0.0,)
        call = cls(adapters.entry(), np.array([row]), *free)
        call.words = words
        call.recipe = cls.of, (kernel, arguments, timed)
        return call

    @classmethod
    def of_function(
        cls, address: int, words: Sequence[int], recipe: tuple[Any, tuple[Any, ...]]
    ) -> Self:
        """Return a call of a C function whose arguments are integers and pointers."""
        from hsp_control.compiled import adapters

        packed = np.array([address, *words], dtype=np.int64)
        row = adapters.foreign_adapter(len(words)), packed.ctypes.data
        call = cls(adapters.entry(), np.array([row]), 0.0)
        call.words, call.recipe = packed, recipe
        return call

    @classmethod
    def over(
        cls, kernel: Callable[..., Any], calls: "Sequence[NativeCall]", *arguments: Any
    ) -> Self:
        """Return a call of a kernel that makes calls: their rows are given first."""
        given = rows_of(calls), *arguments
        call = cls.of(kernel, given, timed=False)
        call.recipe, call.kept = (cls.over, (kernel, calls, *arguments)), given
        return call

    def __reduce__(self) -> tuple[Any, ...]:
        return self.recipe


def are_native(calls: Sequence[object]) -> TypeGuard[Sequence[NativeCall]]:
    """Return whether all of these calls are native."""
    return all(isinstance(call, NativeCall) for call in calls)


def rows_of(calls: Sequence[NativeCall]) -> Indices:
    """Return calls as kernels make them: their addresses, not the calls, (parts, 2)."""
    none = np.zeros((0, 2), dtype=np.int64)
    return np.concatenate([none, *(call.args[0] for call in calls)])


def bind(
    function: Callable[..., Any], *arguments: Any, timed: bool = False
) -> Callable[..., Any]:
    """Return a call of a kernel with these arguments.

    Args:
        function: The kernel; it returns nothing or one number.
        arguments: Arrays, numbers, and tuples or records of them. The call reads and
            writes the memory of these arrays each time; numbers are constants.
        timed: Whether the kernel has one more argument, the time, given to the call.
    """
    if is_compiled(function):
        from hsp_control.compiled import adapters  # here: plain runs need no Numba

        if adapters.AVAILABLE:
            return NativeCall.of(function, arguments, timed)
    return partial(function, *arguments)


def once(calls: Sequence[Callable[[], object]], stamp: Indices) -> Callable[[], object]:
    """Return one call that makes several, unless it made them at this stamp, (1,)."""
    made = np.full(1, -1)
    if not are_native(calls):
        return partial(_make_once, calls, stamp, made)
    from hsp_control.compiled.adapters import run_once

    return NativeCall.over(run_once, calls, stamp, made)


def _make_once(
    calls: Sequence[Callable[[], object]], stamp: Indices, made: Indices
) -> None:
    """Do the same, where calls are made one by one."""
    if made[0] != stamp[0]:
        made[0] = stamp[0]
        for call in calls:
            call()


def only_if(calls: Sequence[Callable[[], float]], found: Array) -> Callable[[], float]:
    """Return one call that makes several if ``found[1]`` is not zero, found (2,)."""
    if not are_native(calls):
        return partial(_make_if, calls, found)
    from hsp_control.compiled.adapters import run_if

    return NativeCall.over(run_if, calls, found)


def _make_if(calls: Sequence[Callable[[], float]], found: Array) -> float:
    """Do the same, where calls are made one by one."""
    value, last = float(found[0]), 0.0
    if found[1] != 0.0:
        for call in calls:
            last = call()
    return value + last


def sequence(calls: Sequence[NativeCall], *free: float) -> NativeCall:
    """Return one call of the time that makes several; it returns the last result."""
    from hsp_control.compiled import adapters

    call = NativeCall(adapters.entry(), rows_of(calls), *free)
    call.recipe = sequence, (calls, *free)
    return call


def stay(t: float) -> None:
    """Do nothing: the follower of a constant sample that is already written."""


class StepPlan(NamedTuple):
    """The calls that evaluate one part of a controller, at whatever the state is."""

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


def planned(calls: KernelCalls) -> StepPlan:
    """Return the plan of a part's calls; one that comes twice is bound once."""
    follow: list[Callable[[float], object]] = []
    write: list[Callable[[], Any]] = []
    bound: dict[int, tuple[Callable[[], Any], ...]] = {}
    for call in calls:
        if id(call) not in bound:
            function, arguments = call
            given, first, before = supplied(arguments)
            follow += [each for each in first if each is not stay]
            bound[id(call)] = *before, bind(function, *given)
        write += bound[id(call)]
    return StepPlan(tuple(follow), tuple(write))


def supplied(argument: Any) -> tuple[Any, tuple[Any, ...], tuple[Any, ...]]:
    """Return an argument as a kernel reads it, and the calls that write it."""
    if type(argument) is KernelOutput:
        return argument.out, *planned([with_outputs(*argument)])
    if hasattr(argument, "supplied"):
        found: tuple[Any, tuple[Any, ...], tuple[Any, ...]] = argument.supplied()
        return found
    if type(argument) is not tuple:
        return argument, (), ()
    parts = [supplied(each) for each in argument]
    follow = tuple(call for _, calls, _ in parts for call in calls)
    write = tuple(call for _, _, calls in parts for call in calls)
    return tuple(value for value, _, _ in parts), follow, write


class CallSequence:
    """Several calls as one, with the result of the last."""

    def __init__(self, *calls: Callable[..., Any]) -> None:
        self.calls = calls  # the calls, in order

    def __call__(self, *arguments: float) -> Any:
        """Make the calls in order."""
        return [call(*arguments) for call in self.calls][-1]


def one_call(calls: Sequence[Callable[..., Any]], *free: float) -> Callable[..., Any]:
    """Return one call for several, with the result of the last: native if all are."""
    return sequence(calls, *free) if are_native(calls) else CallSequence(*calls)


def steps(
    plans: Iterable[StepPlan], last: Callable[[], Any]
) -> list[Callable[[float], Any]]:
    """Return the calls of a step: all references first; native ones as one call."""
    plans = list(plans)
    parts = [part for p in plans for follow in p.follow for part in _parts(follow)]
    for write in [*(write for p in plans for write in p.write), last]:
        parts += [
            part if isinstance(part, NativeCall) else _whenever(part)
            for part in _parts(write)
        ]
    found: list[Callable[[float], Any]] = []
    for _, group in groupby(parts, lambda part: isinstance(part, NativeCall)):
        calls = [*group]
        found += [sequence(calls)] if are_native(calls) else calls
    return found


def in_order(calls: Sequence[Callable[[], object]]) -> list[Callable[[float], Any]]:
    """Return calls without arguments as calls of the time, native ones as one."""
    return steps([StepPlan(write=tuple(calls[:-1]))], calls[-1])


def _parts(call: Callable[..., Any]) -> Iterator[Callable[..., Any]]:
    """Yield the single calls of a call."""
    if isinstance(call, CallSequence):
        for each in call.calls:
            yield from _parts(each)
    elif call is not stay:
        yield call


def _whenever(call: Callable[[], Any]) -> Callable[[float], Any]:
    return lambda t: call()
