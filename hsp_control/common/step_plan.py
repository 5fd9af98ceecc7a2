"""What a step does, decided once: calls that know where they read and write."""

from collections.abc import Callable, Iterable, Iterator
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.native import FOREVER, NativeCall, Timed, sequence


class StepPlan(NamedTuple):
    """An evaluation at whatever a state then is, taken apart into its calls.

    Asking at every step what is to be called costs as much as the small kernels do.

    Attributes:
        follow: Bring references up to a time [s].
        write: Read the state, and write.
    """

    follow: tuple[Callable[[float], object], ...] = ()
    write: tuple[Callable[[], object], ...] = ()


class CallSequence:
    """Several calls as one.

    Attributes:
        calls: Them.
        result: Which of them says what is returned.
    """

    def __init__(self, *calls: Callable[..., Any], result: int = -1) -> None:
        """Keep the calls."""
        self.calls = calls
        self.result = result

    def __call__(self, *arguments: float) -> Any:
        """Make the calls."""
        return [call(*arguments) for call in self.calls][self.result]


class TimeWindow:
    """A call of the time that is made only from one time until another.

    Attributes:
        call: It.
        start: From when it is made [s].
        end: Until when [s].
    """

    def __init__(
        self, call: Callable[[float], object], start: float, end: float
    ) -> None:
        """Keep the call and its times."""
        self.call, self.start, self.end = call, start, end

    def __call__(self, t: float) -> None:
        """Make the call, if it is time."""
        if self.start <= t < self.end:
            self.call(t)


def steps(
    bounds: Iterable[StepPlan], last: Callable[[], Any]
) -> list[Callable[[float], Any]]:
    """Return what to call with the time, in turn: all of the bounds, and then ``last``.

    References come before what reads them. Native calls that follow one another become
    one call.
    """
    bounds = list(bounds)
    parts = [p for b in bounds for follow in b.follow for p in _parts(follow)]
    for write in [*(write for b in bounds for write in b.write), last]:
        parts += [
            part if isinstance(part.call, NativeCall) else _Part(_whenever(part.call))
            for part in _parts(write)
        ]
    found: list[Callable[[float], Any]] = []
    for native, group in groupby(parts, lambda p: isinstance(p.call, NativeCall)):
        if native:
            found.append(sequence([Timed(*part) for part in group]))
        else:
            found += [_when(*part) for part in group]
    return found


class _Part(NamedTuple):
    call: Any
    start: float = FOREVER[0]
    end: float = FOREVER[1]


def _parts(
    call: Callable[..., Any], start: float = -np.inf, end: float = np.inf
) -> Iterator[_Part]:
    """Yield what a call consists of, and when."""
    if isinstance(call, CallSequence):
        for each in call.calls:
            yield from _parts(each, start, end)
    elif isinstance(call, TimeWindow):
        yield from _parts(call.call, max(start, call.start), min(end, call.end))
    else:
        yield _Part(call, start, end)


def _when(
    call: Callable[[float], Any], start: float, end: float
) -> Callable[[float], Any]:
    return call if (start, end) == FOREVER else TimeWindow(call, start, end)


def _whenever(call: Callable[[], Any]) -> Callable[[float], Any]:
    return lambda t: call()
