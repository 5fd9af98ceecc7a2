"""Where the machine code of kernels is kept on disk, and when it is stale.

Numba takes kept code for fresh while the text of the function's own file is the same.
That is too strict, since a comment recompiles, and too lax, since the code of kernels
in other files is compiled into it. Here kept code is fresh while the *bytecode* of the
function and the value of everything that it reads, kernels included, are the same.

A wheel brings machine code with it, for a processor that all others contain
(`tools/machine_code.py`). It is used where no other is kept, under the same conditions:
the same version of Numba, and the same bytecode.
"""

import hashlib
import os
import warnings
from collections.abc import Callable, Iterator
from functools import cache, cached_property
from pathlib import Path
from platform import machine
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite.binding
import numpy as np
from numba.core import types
from numba.core.caching import (
    Cache,
    CompileResultCacheImpl,
    InTreeCacheLocator,
    UserProvidedCacheLocator,
    UserWideCacheLocator,
    _CacheLocator,
)

from hsp_control.common.resources import bundled

_COMPILERS = ("llvmlite", "math", "numba", "numpy")
"""Packages whose modules stand for themselves: Numba checks its own version."""

_HOW = b"".join(
    Path(__file__).with_name(file).read_bytes()
    for file in ("kernels.py", "kernel_lowering.py", "linked_kernels.py")
)
"""The files that say how kernels are compiled."""


def shipped_processor() -> tuple[str, tuple[str, ...]]:
    """Return the processor that shipped code is for, and what it must be capable of."""
    if machine() in ("x86_64", "AMD64"):
        return "x86-64-v3", ("avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
    return "generic", ()


class Kept:
    """Where the machine code of a function is kept, as Numba's dispatchers use it.

    Beside the package's files, or where these are read-only in the user's cache
    folder; the environment variable ``NUMBA_CACHE_DIR`` names another. Where nothing
    can be written, nothing is kept, and a warning says so.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        """Find the place."""
        self._function = function
        try:
            self._own: Any = _KernelCache(function)  # type: ignore[no-untyped-call]
        except RuntimeError as error:  # Numba found no folder to keep the code in
            if "cannot cache" not in str(error):
                raise
            self._own = None

    @property
    def cache_path(self) -> str | None:
        """The folder, for Numba's statistics."""
        return self._own and str(self._own.cache_path)

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the code for a signature, None if there is none that can be read."""
        found = self._own and self._own.load_overload(sig, target_context)
        if found is None and _shipped_code_runs_here():
            shipped: Any = _ShippedCache(self._function)  # type: ignore[no-untyped-call]
            found = shipped.load_overload(sig, target_context)
        return found

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep code that was compiled; a full disk only costs the time of the next."""
        if self._own is None:
            _warn_of_no_cache()
            return
        try:
            self._own.save_overload(sig, data)
        except OSError:
            _warn_of_no_cache()


class Stamp:
    """What the machine code of a function depends on.

    It is computed at the first comparison: a kernel may call one that is defined
    further down in its file.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function

    @cached_property
    def digest(self) -> str:
        """The dependencies' digest."""
        state = hashlib.sha256(_HOW)
        for part in _function(self._function, set()):
            state.update(part)
            state.update(b"\0")
        return state.hexdigest()

    def __eq__(self, other: object) -> bool:
        return self.digest == (other.digest if isinstance(other, Stamp) else other)

    def __hash__(self) -> int:
        return hash(self.digest)

    def __reduce__(self) -> tuple[Any, ...]:  # what Numba writes beside the code
        return str, (self.digest,)


def _function(function: Any, seen: set[int]) -> Iterator[bytes]:
    """Yield what a function does, and the values that it reads."""
    if id(function) in seen:
        return
    seen.add(id(function))
    names: set[str] = set()
    yield from _code(function.__code__, function.__doc__, names)
    for name in sorted(names & function.__globals__.keys()):
        yield name.encode()
        yield from _value(function.__globals__[name], seen)
    for cell in (*(function.__closure__ or ()), function.__defaults__):
        yield from _value(getattr(cell, "cell_contents", cell), seen)


def _code(code: CodeType, docstring: str | None, names: set[str]) -> Iterator[bytes]:
    """Yield what code does; collect the names of what it reads."""
    names.update(code.co_names)
    yield code.co_code
    yield repr((code.co_names, code.co_varnames, code.co_argcount)).encode()
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _code(constant, None, names)
        elif docstring is None or constant != docstring:
            yield repr(constant).encode()


def _value(value: Any, seen: set[int]) -> Iterator[bytes]:
    """Yield the contents of a value that a kernel reads."""
    function = getattr(value, "py_func", getattr(value, "_defn", value))
    if isinstance(function, FunctionType):
        yield from _function(function, seen)
    elif isinstance(value, ModuleType):
        ours = value.__name__.split(".")[0] not in _COMPILERS
        file = getattr(value, "__file__", None) if ours else None
        yield value.__name__.encode()
        yield Path(file).read_bytes() if file else b""
    elif isinstance(value, np.ndarray):
        yield f"{value.dtype} {value.shape}".encode()
        yield value.tobytes()
    elif isinstance(value, tuple):
        for each in value:
            yield from _value(each, seen)
    elif isinstance(value, type | BuiltinFunctionType | np.ufunc):
        yield f"{value.__module__}.{value.__name__}".encode()
        yield repr(getattr(value, "_fields", ())).encode()  # of a record
    elif value is None or isinstance(
        value, bool | int | float | complex | str | np.generic | types.Type
    ):
        yield repr(value).encode()
    else:
        yield os.urandom(16)


class _ByContent:
    """Makes one of Numba's locators use a `Stamp` in place of a digest of the file.

    The name of the file on disk does not contain the function's line number either.
    """

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        super().__init__(function, file)  # type: ignore[call-arg]
        self._function = function

    def get_source_stamp(self) -> Stamp:
        return Stamp(self._function)

    def get_disambiguator(self) -> str:
        return "kernel"


def _by_content(locator: Any) -> Any:
    return type(locator.__name__, (_ByContent, locator), {})


class _KernelCacheImpl(CompileResultCacheImpl):
    _locator_classes = [  # noqa: RUF012 (as Numba has it)
        _by_content(UserProvidedCacheLocator),
        _by_content(InTreeCacheLocator),
        _by_content(UserWideCacheLocator),
    ]


class _Shipped(_ByContent, _CacheLocator):
    """Places shipped code in one folder, wherever the function's file is."""

    def __init__(self, function: Callable[..., Any], file: str) -> None:
        self._function = function

    def get_cache_path(self) -> str:
        return str(bundled("machine_code"))

    @classmethod
    def from_function(cls, function: Callable[..., Any], file: str) -> "_Shipped":
        return cls(function, file)


class _ShippedImpl(CompileResultCacheImpl):
    _locator_classes = [_Shipped]  # noqa: RUF012 (as Numba has it)


class _KernelCache(Cache):
    _impl_class: Any = _KernelCacheImpl

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return kept code, None if none fits: records that it names may be gone."""
        try:
            return self._load_overload(sig, target_context)  # type: ignore[no-untyped-call]
        except Exception:  # whatever unpickling raises
            self.flush()  # type: ignore[no-untyped-call]
            return None


class _ShippedCache(_KernelCache):
    _impl_class = _ShippedImpl

    def flush(self) -> None:
        """Leave what is shipped as it is."""

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        sig, (triple, *_), code = super()._index_key(sig, codegen)  # type: ignore[no-untyped-call]
        return sig, (triple, shipped_processor()[0], ""), code


@cache
def _shipped_code_runs_here() -> bool:
    """Say whether there is shipped code, and this processor can run it."""
    features: Any = llvmlite.binding.get_host_cpu_features()
    needed = shipped_processor()[1]
    return bundled("machine_code").is_dir() and all(map(features.get, needed))


@cache
def _warn_of_no_cache() -> None:
    warnings.warn(
        "compiled code cannot be kept: neither the package's folder nor the user's "
        "cache can be written. Every start will take some ten seconds longer; set "
        "NUMBA_CACHE_DIR to a folder that can be written",
        RuntimeWarning,
        stacklevel=2,
    )
