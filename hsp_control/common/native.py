"""Native calls: kernels with their arguments, run without Python in between.

From Python, each array argument costs 6 ns, the entry into compiled code 50 ns, and one
step of a loop 60 ns. For a kernel of 0.1 µs with ten arrays that is more than its work.
`bind` packs the arguments once into words of memory, and compiles an adapter that reads
them there. All adapters have one signature, whatever the kernel's, so that `run` can
call them by their addresses.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple, Self, TypeGuard

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import is_compiled

FOREVER = -np.inf, np.inf
"""The window of time of a call that is always made [s]."""


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
        from hsp_control.common import adapters

        kinds, words = adapters.packed(arguments)
        address = adapters.adapter(kernel, kinds, timed)
        row = address, words.ctypes.data
        free = () if timed else (0.0,)
        call = cls(adapters.entry(), np.array([row]), np.array([FOREVER]), *free)
        call.words = words
        call.recipe = cls.of, (kernel, arguments, timed)
        return call

    @classmethod
    def of_function(
        cls, address: int, words: Sequence[int], recipe: tuple[Any, tuple[Any, ...]]
    ) -> Self:
        """Return a call of a C function whose arguments are integers and pointers."""
        from hsp_control.common import adapters

        packed = np.array([address, *words], dtype=np.int64)
        row = adapters.foreign_adapter(len(words)), packed.ctypes.data
        call = cls(adapters.entry(), np.array([row]), np.array([FOREVER]), 0.0)
        call.words, call.recipe = packed, recipe
        return call

    @classmethod
    def over(
        cls, kernel: Callable[..., Any], calls: "Sequence[NativeCall]", *arguments: Any
    ) -> Self:
        """Return a call of a kernel that makes calls: their `table` is given first."""
        given = *table(calls), *arguments
        call = cls.of(kernel, given, timed=False)
        call.recipe, call.kept = (cls.over, (kernel, calls, *arguments)), given
        return call

    def __reduce__(self) -> tuple[Any, ...]:
        return self.recipe


def are_native(calls: Sequence[object]) -> TypeGuard[Sequence[NativeCall]]:
    """Return whether all of these calls are native."""
    return all(isinstance(call, NativeCall) for call in calls)


def table(calls: Sequence[NativeCall]) -> tuple[Indices, Array]:
    """Return calls' addresses, not the calls, and their windows, shape (parts, 2)."""
    rows = [np.zeros((0, 2), dtype=np.int64), *(call.args[0] for call in calls)]
    when = [np.zeros((0, 2)), *(call.args[1] for call in calls)]
    return np.concatenate(rows), np.concatenate(when)


class Timed(NamedTuple):
    """A call and when it is made."""

    call: Any  # the call; a native one in a `sequence`
    start: float = FOREVER[0]  # start of its window of time [s]
    end: float = FOREVER[1]  # end of its window [s]


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
        from hsp_control.common import adapters  # here: plain runs need no Numba

        if adapters.AVAILABLE:
            return NativeCall.of(function, arguments, timed)
    return partial(function, *arguments)


def once(calls: Sequence[Callable[[], object]], stamp: Indices) -> Callable[[], object]:
    """Return one call that makes several, unless it made them at this stamp, (1,)."""
    made = np.full(1, -1)
    if not are_native(calls):
        return partial(_make_once, calls, stamp, made)
    from hsp_control.common.adapters import run_once

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
    from hsp_control.common.adapters import run_if

    return NativeCall.over(run_if, calls, found)


def _make_if(calls: Sequence[Callable[[], float]], found: Array) -> float:
    """Do the same, where calls are made one by one."""
    value, last = float(found[0]), 0.0
    if found[1] != 0.0:
        for call in calls:
            last = call()
    return value + last


def sequence(calls: Sequence[Timed], *free: float) -> NativeCall:
    """Return one call of the time that makes several; it returns the last result."""
    from hsp_control.common import adapters

    rows = np.concatenate([each.call.args[0] for each in calls])
    when = np.concatenate([_within(*each) for each in calls])
    call = NativeCall(adapters.entry(), rows, when, *free)
    call.recipe = sequence, (calls, *free)
    return call


def _within(call: NativeCall, start: float, end: float) -> Array:
    """Return the windows of a call's parts within another window, shape (parts, 2)."""
    windows: Array = call.args[1]
    return np.column_stack(
        [np.maximum(windows[:, 0], start), np.minimum(windows[:, 1], end)]
    )
