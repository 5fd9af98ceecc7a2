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

import numpy as np

from hsp_control.common.kernels import KernelCall
from hsp_control.common.native import (
    FOREVER,
    NativeCall,
    Timed,
    are_native,
    bind,
    sequence,
)


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
    given, follow, write = _supplied(arguments)
    return StepPlan(follow, (*write, bind(function, *given, *others)))


def _supplied(argument: Any) -> tuple[Any, tuple[Any, ...], tuple[Any, ...]]:
    """Return an argument as a kernel reads it, and the calls that write it."""
    if hasattr(argument, "supplied"):
        found: tuple[Any, tuple[Any, ...], tuple[Any, ...]] = argument.supplied()
        return found
    if type(argument) is not tuple:
        return argument, (), ()
    parts = [_supplied(each) for each in argument]
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


class TimeWindow:
    """A call of the time that is made only within a window of time."""

    def __init__(
        self, call: Callable[[float], object], start: float, end: float
    ) -> None:
        # the window [s]; at its end the call is not made
        self.call, self.start, self.end = call, start, end

    def __call__(self, t: float) -> None:
        """Make the call if the time is within the window."""
        if self.start <= t < self.end:
            self.call(t)


def steps(
    plans: Iterable[StepPlan], last: Callable[[], Any]
) -> list[Callable[[float], Any]]:
    """Return the calls of a step: all references first; native ones as one call."""
    plans = list(plans)
    parts = [part for p in plans for follow in p.follow for part in _parts(follow)]
    for write in [*(write for p in plans for write in p.write), last]:
        parts += [
            part if isinstance(part.call, NativeCall) else Timed(_whenever(part.call))
            for part in _parts(write)
        ]
    found: list[Callable[[float], Any]] = []
    for native, group in groupby(parts, lambda p: isinstance(p.call, NativeCall)):
        if native:
            found.append(sequence(list(group)))
        else:
            found += [_when(*part) for part in group]
    return found


def merged(call: Callable[[float], Any]) -> Callable[[float], Any]:
    """Return a call of the time as one native call, if all its parts are native."""
    parts = list(_parts(call))
    if len(parts) < 2 or not are_native([each.call for each in parts]):
        return call
    return sequence(parts)


def in_order(calls: Sequence[Callable[[], object]]) -> list[Callable[[float], Any]]:
    """Return calls without arguments as calls of the time, native ones as one."""
    return steps([StepPlan(write=tuple(calls[:-1]))], calls[-1])


def _parts(
    call: Callable[..., Any], start: float = -np.inf, end: float = np.inf
) -> Iterator[Timed]:
    """Yield the single calls of a call, each with its window of time."""
    if isinstance(call, CallSequence):
        for each in call.calls:
            yield from _parts(each, start, end)
    elif call is stay:
        return
    elif isinstance(call, TimeWindow):
        yield from _parts(call.call, max(start, call.start), min(end, call.end))
    else:
        yield Timed(call, start, end)


def _when(
    call: Callable[[float], Any], start: float, end: float
) -> Callable[[float], Any]:
    return call if (start, end) == FOREVER else TimeWindow(call, start, end)


def _whenever(call: Callable[[], Any]) -> Callable[[float], Any]:
    return lambda t: call()
