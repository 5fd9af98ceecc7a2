"""Step plans: the calls of a step, decided once, that know where to read and write.

A part says its mathematics as a kernel with its arguments, a `KernelCall`. An argument
may be something that has to be brought up to date first: the kinematics of a frame, a
trajectory, what another kernel writes. Its method ``supplied`` returns what the kernel
reads, and the calls that write it: those of the time, and those that read the state.
`planned` makes a step plan of it all.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import groupby
from typing import Any, NamedTuple

from hsp_control.common.kernels import KernelCall
from hsp_control.common.native import NativeCall, are_native, bind, sequence


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


class KernelOutput:
    """An argument of a kernel: what another kernel writes into its last argument."""

    def __init__(self, call: KernelCall, out: Any) -> None:
        self._call, self._out = call, out

    def supplied(self) -> tuple[Any, ...]:
        """Return the output, and the calls that write it."""
        return self._out, *planned(self._call, self._out)


def planned(call: KernelCall, *others: Any) -> StepPlan:
    """Return the plan of a kernel's call, with further arguments after its own."""
    function, arguments = call
    given, follow, write = supplied(arguments)
    return StepPlan(follow, (*write, bind(function, *given, *others)))


def supplied(argument: Any) -> tuple[Any, tuple[Any, ...], tuple[Any, ...]]:
    """Return an argument as a kernel reads it, and the calls that write it."""
    if hasattr(argument, "supplied"):
        found: tuple[Any, tuple[Any, ...], tuple[Any, ...]] = argument.supplied()
        return found
    if type(argument) is not tuple:
        return argument, (), ()
    parts = [supplied(each) for each in argument]
    follow = tuple(call for _, calls, _ in parts for call in calls)
    write = tuple(call for _, _, calls in parts for call in calls)
    return tuple(value for value, _, _ in parts), follow, write


def says(part: object, *ways: str) -> str:
    """Return by which of several methods a part's class says its mathematics.

    It is the one of the most derived class, so that whoever derives from a part of the
    package may override any of them; the first, if one class has several.
    """
    for each in type(part).__mro__:
        for way in ways:
            if way in vars(each):
                return way
    raise AttributeError(f"{type(part).__name__} has none of {', '.join(ways)}")


class CallSequence:
    """Several calls as one."""

    def __init__(self, *calls: Callable[..., Any], result: int = -1) -> None:
        self.calls = calls  # the calls, in order
        self.result = result  # the index of the call whose result is returned

    def __call__(self, *arguments: float) -> Any:
        """Make the calls in order."""
        return [call(*arguments) for call in self.calls][self.result]


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
