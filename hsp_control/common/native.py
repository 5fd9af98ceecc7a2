"""Native calls: kernels with their arguments, run without Python in between.

From Python, each array argument costs 6 ns, the entry into compiled code 50 ns, and one
step of a loop 60 ns. For a kernel of 0.1 µs with ten arrays that is more than its work.
`bind` packs the arguments once into words of memory, and compiles an adapter that reads
them there. All adapters have one signature, whatever the kernel's, so that `run` can
call them by their addresses.
"""

import hashlib
import warnings
from collections.abc import Callable, Sequence
from functools import cache, partial
from types import FunctionType
from typing import Any, NamedTuple, Self, cast

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core.datamodel.registry import default_manager
from numba.extending import intrinsic

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import callback, is_compiled, kernel

FOREVER = -np.inf, np.inf
"""The window of time of a call that is always made [s]."""


_ARRAY = ("meminfo", "parent", "nitems", "itemsize", "data", "shape", "strides")
"""The words of an array in Numba's compiled code, in order."""


class NativeCall(partial[float]):
    """A kernel with its arguments: a call without arguments, or of the time.

    It is a `partial` because Python calls nothing faster.

    Attributes:
        row: The addresses of the adapter and of the words, as `run` reads them.
        words: The packed arguments.
        recipe: A function and its arguments that make this call. It keeps the arrays
            alive, and copies and pickles use it to bind the copied arrays.
    """

    row: tuple[int, int]
    words: Array
    recipe: tuple[Callable[..., Any], tuple[Any, ...]]

    @classmethod
    def of(
        cls, kernel: Callable[..., Any], arguments: tuple[Any, ...], timed: bool
    ) -> Self:
        """Pack the arguments, and compile or load the adapter."""
        kinds, words = zip(*map(_packed, arguments), strict=True)
        table = np.concatenate(words)
        address = _adapter(kernel, kinds, timed)
        row = address, table.ctypes.data
        free = () if timed else (0.0,)
        call = cls(_entry(), np.array([row]), np.array([FOREVER]), *free)
        call.row, call.words = row, table
        call.recipe = cls.of, (kernel, arguments, timed)
        return call

    def __reduce__(self) -> tuple[Any, ...]:
        return self.recipe


class Timed(NamedTuple):
    """A native call within a sequence.

    Attributes:
        call: The call.
        start: Start of its window of time [s].
        end: End of its window [s].
    """

    call: NativeCall
    start: float
    end: float


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
    if not (AVAILABLE and is_compiled(function)):
        return partial(function, *arguments)
    return NativeCall.of(function, arguments, timed)


def sequence(calls: Sequence[Timed]) -> Callable[[float], float]:
    """Return one call of the time that makes several; it returns the last result."""
    when = np.array([[each.start, each.end] for each in calls])
    call = NativeCall(_entry(), np.array([each.call.row for each in calls]), when)
    call.recipe = sequence, (calls,)
    return call


def unknown_layout() -> str:
    """Return what of Numba's memory layout is not as `_packed` has it, or nothing."""
    lookup: Callable[[Any], Any] = default_manager.lookup
    array = lookup(types.float64[:, ::1])
    pair = lookup(cast("Any", types).Tuple((types.int64,) * 2))
    found = getattr(array, "_fields", ())
    if found != _ARRAY:
        return f"an array is {', '.join(found)}; known is {', '.join(_ARRAY)}"
    if not isinstance(pair.get_value_type(), ir.ArrayType):
        return f"a tuple of two integers is {pair.get_value_type()}; known is [2 x i64]"
    return ""


def _packed(argument: Any) -> tuple[types.Type, Array]:
    """Return an argument's type, and what stands for it in memory."""
    if isinstance(argument, np.ndarray):
        kind = cast("Callable[[Any], types.Type]", numba.typeof)(argument)
        size, item, at = argument.size, argument.itemsize, argument.ctypes.data
        shape = *argument.shape, *argument.strides
        # Two owners come first in Numba's arrays, of which kernels know nothing.
        return kind, np.array([0, 0, size, item, at, *shape], dtype=np.int64)
    if isinstance(argument, tuple):  # a record: its values, one after the other
        kind = cast("Callable[[Any], types.Type]", numba.typeof)(argument)
        return kind, np.concatenate([_packed(value)[1] for value in argument])
    if isinstance(argument, bool | int | np.integer | np.bool_):
        return types.int64, np.array([argument], dtype=np.int64)
    return types.float64, np.array([argument], dtype=float).view(np.int64)


@cache
def _adapter(
    kernel: Callable[..., Any], kinds: tuple[types.Type, ...], timed: bool
) -> int:
    """Return the address of what calls a kernel: f(where its arguments are, time)."""
    template = _call_at_a_time if timed else _call
    place = {
        "__name__": __name__,
        "kernel": kernel,
        "arguments": cast("Any", types).Tuple(kinds),
        "_unpacked": _unpacked,
        "_number": _number,
    }
    function = FunctionType(cast("FunctionType", template).__code__, place)
    digest = hashlib.sha256(f"{kinds} {timed}".encode()).hexdigest()[:12]
    name = f"{kernel.__module__}_{kernel.__name__}_{digest}".replace(".", "_")
    function.__qualname__ = name
    signature = types.float64(types.int64, types.float64)
    code = callback(signature, function)
    _codes.append(code)
    return int(code.address)


_codes: list[Any] = []
"""What has been compiled: its addresses are used for as long as the process lives."""


def _call(words: int, t: float) -> float:
    return _number(kernel(*_unpacked(words, arguments)))  # type: ignore # noqa


def _call_at_a_time(words: int, t: float) -> float:
    return _number(kernel(*_unpacked(words, arguments), t))  # type: ignore # noqa


@intrinsic
def _number(typing: Any, value: Any) -> Any:
    """Return what a kernel returned as a number, 0 for nothing."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if isinstance(value, types.NoneType):
            return context.get_constant(types.float64, 0.0)
        return context.cast(builder, arguments[0], value, types.float64)

    return types.float64(value), code


@intrinsic
def _unpacked(typing: Any, words: Any, kind: Any) -> Any:
    """Return the values of the types of a tuple that lie at an address."""
    values = kind.instance_type

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = context.get_value_type(values).as_pointer()
        return builder.load(builder.inttoptr(arguments[0], pointer))

    return values(types.int64, kind), code


@intrinsic
def _invoke(typing: Any, address: Any, words: Any, t: Any) -> Any:
    """Call what `_adapter` made."""

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kind = ir.FunctionType(ir.DoubleType(), [ir.IntType(64), ir.DoubleType()])
        function = builder.inttoptr(arguments[0], kind.as_pointer())
        return builder.call(function, arguments[1:])

    return types.float64(types.int64, types.int64, types.float64), code


@kernel
def run(calls: Indices, when: Array, t: float) -> float:
    """Make calls, each a row (code, arguments), those at whose time it is.

    Returns:
        What the last one returned.
    """
    value = 0.0
    for k in range(calls.shape[0]):
        if when[k, 0] <= t < when[k, 1]:
            value = _invoke(calls[k, 0], calls[k, 1], t)  # type: ignore[call-arg]
    return value


@cache
def _entry() -> Callable[..., float]:
    """Return `run` as Python calls it without asking for types."""
    kinds = types.int64[:, ::1], types.float64[:, ::1], types.float64
    compiled_run = cast("Any", run)
    compiled_run.compile(kinds)
    return cast("Callable[..., float]", compiled_run.overloads[kinds].entry_point)


def _available() -> bool:
    if complaint := unknown_layout():
        warnings.warn(
            f"kernels are called one by one from Python, which doubles the time of a "
            f"step: in Numba {numba.__version__} {complaint}. Install a version that "
            "hsp_control declares",
            RuntimeWarning,
            stacklevel=2,
        )
        return False
    return True


AVAILABLE = _available()
"""Whether calls are packed; otherwise they are ordinary ones, with the same results."""
