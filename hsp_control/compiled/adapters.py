"""The compiled side of native calls: adapters that read packed arguments and call.

An adapter is f(address of the words, time), whatever the kernel's own arguments are.
"""

import hashlib
import struct
import warnings
from collections.abc import Callable
from types import FunctionType
from typing import Any, cast

import numba
import numpy as np
from llvmlite import ir
from numba import types
from numba.core.datamodel.registry import default_manager
from numba.extending import intrinsic
from numpy.typing import NDArray

from hsp_control.common.arrays import Indices
from hsp_control.compiled.kernels import callback

_ARRAY = ("meminfo", "parent", "nitems", "itemsize", "data", "shape", "strides")
"""The words of an array in Numba's compiled code, in order."""


def unknown_layout() -> str:
    """Return what of Numba's memory layout is not as `packed` has it, or nothing."""
    lookup: Callable[[Any], Any] = default_manager.lookup
    array = lookup(types.float64[:, ::1])
    pair = lookup(cast("Any", types).Tuple((types.int64,) * 2))
    found = getattr(array, "_fields", ())
    if found != _ARRAY:
        return f"an array is {', '.join(found)}; known is {', '.join(_ARRAY)}"
    if not isinstance(pair.get_value_type(), ir.ArrayType):
        return f"a tuple of two integers is {pair.get_value_type()}; known is [2 x i64]"
    return ""


def packed(arguments: tuple[Any, ...]) -> tuple[tuple[types.Type, ...], Indices]:
    """Return the types of arguments, and what stands for them in memory."""
    words: list[int] = []
    kinds = tuple(_pack(argument, words) for argument in arguments)
    return kinds, np.array(words, dtype=np.int64)


def _pack(argument: Any, words: list[int]) -> types.Type:
    """Append what stands for an argument in memory, and return its type."""
    if isinstance(argument, np.ndarray):
        # Two owners come first in Numba's arrays, of which kernels know nothing.
        words += 0, 0, argument.size, argument.itemsize, argument.ctypes.data
        words += argument.shape
        words += argument.strides
        return _kind_of_array(argument)
    if isinstance(argument, tuple):  # a record: its values, one after the other
        kinds = tuple([_pack(value, words) for value in argument])
        return _kind_of_tuple(kinds, type(argument))
    if isinstance(argument, bool | int | np.integer | np.bool_):
        words.append(int(argument))
        return types.int64
    words += _BITS.unpack(_NUMBER.pack(argument))
    return types.float64


_NUMBER, _BITS = struct.Struct("d"), struct.Struct("q")
_kinds: dict[tuple[Any, ...], types.Type] = {}
"""Types that were found, each once: they are known by identity, as Numba's own equality
looks at all that is in them."""
_addresses: dict[tuple[Any, ...], int] = {}
"""Adapters that were made, by their kernels and the types of their arguments."""


def _kind_of_array(array: NDArray[Any]) -> types.Type:
    """Return `numba.typeof` of an array, which takes ten times as long as to look."""
    flags = array.flags
    key = (
        array.dtype, array.ndim, flags.c_contiguous, flags.f_contiguous,
        flags.writeable, flags.aligned,
    )  # fmt: skip
    kind = _kinds.get(key)
    if kind is None:
        kind = _kinds[key] = cast("Callable[[Any], types.Type]", numba.typeof)(array)
    return kind


def _kind_of_tuple(kinds: tuple[types.Type, ...], record: type) -> types.Type:
    key = record, *map(id, kinds)
    kind = _kinds.get(key)
    if kind is None:
        kind = cast("Any", types).BaseTuple.from_types(kinds, record)
        _kinds[key] = kind
    return kind


def adapter(
    function: Callable[..., Any], kinds: tuple[types.Type, ...], timed: bool
) -> int:
    """Return the address of what calls a kernel: f(where its arguments are, time)."""
    key = function, timed, *map(id, kinds)
    address = _addresses.get(key)
    if address is None:
        address = _addresses[key] = _compiled(function, kinds, timed)
    return address


def _compiled(
    function: Callable[..., Any], kinds: tuple[types.Type, ...], timed: bool
) -> int:
    template = _call_at_a_time if timed else _call
    place = {
        "__name__": __name__,
        "kernel": function,
        "arguments": cast("Any", types).Tuple(kinds),
        "_unpacked": _unpacked,
        "_number": _number,
    }
    call = FunctionType(cast("FunctionType", template).__code__, place)
    digest = hashlib.sha256(f"{kinds} {timed}".encode()).hexdigest()[:12]
    name = f"{function.__module__}_{function.__name__}_{digest}".replace(".", "_")
    call.__qualname__ = name
    signature = types.float64(types.int64, types.float64)
    code = callback(signature, call)
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
