"""Native calls: kernels with their arguments, run without Python in between.

From Python, each array argument costs 6 ns, the entry into compiled code 50 ns, and one
step of a loop 60 ns. For a kernel of 0.1 µs with ten arrays that is more than its work.
A `NativeCall` packs the arguments once into words of memory, and compiles an adapter
that reads them there. All adapters have one signature, whatever the kernel's, so that
`run` can call them by their addresses.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Self, TypeGuard

import numpy as np

from hsp_control.common.arrays import Indices
from hsp_control.engine import Call


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
    def of_engine(cls, made: Call) -> Self:
        """Return a call of the engine: it has the signature of adapters."""
        from hsp_control.compiled import adapters

        free = () if made.kind.timed else (0.0,)
        call = cls(adapters.entry(), np.array([made.row]), *free)
        call.kept, call.recipe = made, (cls.of_engine, (made,))
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


def sequence(calls: Sequence[NativeCall], *free: float) -> NativeCall:
    """Return one call of the time that makes several; it returns the last result."""
    from hsp_control.compiled import adapters

    call = NativeCall(adapters.entry(), rows_of(calls), *free)
    call.recipe = sequence, (calls, *free)
    return call
