"""The compiled route: small pure functions on arrays, which Numba compiles.

A *kernel* writes its results into arrays that the caller owns, allocates nothing, and
calls only other kernels. There is one implementation of each: with
``NUMBA_DISABLE_JIT=1`` the very same function runs as plain Python, for reading,
debugging and coverage, and Numba is not even imported.
"""

import gc
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager
from functools import partial
from typing import Any, NamedTuple, Self, TypeVar, cast

import numpy as np

from hsp_control.common.arrays import Array, Indices

Function = TypeVar("Function", bound=Callable[..., Any])

KernelCall = tuple[Callable[..., Any], tuple[Any, ...]]
"""A kernel, or another function, with its first arguments: what a part's mathematics
is. Who calls it adds the others. See `step_plan` for what may be among them."""

TIME = object()
"""The last argument of a call that brings a reference up to a time [s]."""


class Once(NamedTuple):
    """Calls that are made unless they were made at this stamp."""

    calls: "KernelCalls"
    stamp: Indices  # shape (1,)
    made: Indices  # the stamp at which they were made last, shape (1,)

    @classmethod
    def at(cls, stamp: Indices, *calls: KernelCall) -> Self:
        """Return calls that were not made yet."""
        return cls(calls, stamp, np.full(1, -1))


class OnlyIf(NamedTuple):
    """Calls that are made if ``found[1]`` is not zero.

    Their result is ``found[0]``, and what the last of them returns if they are made.
    """

    calls: "KernelCalls"
    found: Array  # shape (2,)


AnyCall = KernelCall | Once | OnlyIf
KernelCalls = Sequence[AnyCall]
"""What a part does in each step: its calls with all their arguments, in this order."""


class KernelOutput(NamedTuple):
    """An argument of a kernel: what another kernel writes into its last argument."""

    call: KernelCall
    out: Any


def with_outputs(call: KernelCall, *others: Any) -> KernelCall:
    """Return a call with further arguments after its own."""
    function, arguments = call
    return function, (*arguments, *others)


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


PLAIN = os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0")
"""Whether kernels run as plain Python."""

_OPTIONS: dict[str, Any] = {
    "nopython": True,
    # Division by zero follows NumPy (inf, nan) instead of raising: no branch is spent
    # on it, and finiteness is checked once, at the border (`RobotState.update`).
    "error_model": "numpy",
    # Without the reference counts of Numba's memory manager, handing over an array
    # costs 6 ns instead of 27, a slice nothing; and what allocates does not compile.
    "_nrt": False,
    # Sums may be added in another order and products fused, or no sum would be
    # vectorised: compiled and plain results differ by rounding.
    "fastmath": {"reassoc", "contract"},
}


def kernel(function: Function) -> Function:
    """Compile ``function`` at its first call and keep the machine code on disk.

    See `kernel_cache` for where it is kept, and for how long. A kernel may return
    arrays to other kernels alone, not to Python.
    """
    if PLAIN:
        return function
    import numba

    from hsp_control.compiled.kernel_cache import Kept
    from hsp_control.compiled.linked_kernels import KernelCompiler, linked

    jit = numba.jit(**_OPTIONS, pipeline_class=KernelCompiler)
    compiled = cast("Any", jit(function))
    compiled._cache = Kept(function)
    own = compiled._compiler
    own._compile_core = partial(_watched, own._compile_core)
    inner = linked(function, _OPTIONS)
    inner._compiler._compile_core = partial(_watched, inner._compiler._compile_core)
    compiled.get_call_template = inner.get_call_template
    compiled.get_overload = inner.get_overload
    return cast("Function", compiled)


def is_compiled(function: Callable[..., Any]) -> bool:
    """Say whether a function is a kernel that Numba compiles."""
    return hasattr(function, "overloads")


def callback(signature: Any, function: Callable[..., Any]) -> Any:
    """Return a function of these types, compiled now, for calls by its ``address``."""
    from numba.core.ccallback import CFunc

    from hsp_control.compiled.kernel_cache import Kept
    from hsp_control.compiled.linked_kernels import compile_callable

    arguments = signature.args, signature.return_type
    compiled = cast("Any", CFunc)(function, arguments, locals={}, options=_OPTIONS)
    compiled._cache = Kept(function)
    compile_it = partial(compile_callable, compiled._compiler, function, *arguments)
    compiled._compile_uncached = partial(_watched, compile_it)
    compiled.compile()
    return compiled


_watchers: list[Callable[[], AbstractContextManager[None]]] = []


@contextmanager
def watched(watcher: Callable[[], AbstractContextManager[None]]) -> Iterator[None]:
    """Enter the watcher's context around each compilation not found on disk."""
    _watchers.append(watcher)
    try:
        yield
    finally:
        _watchers.remove(watcher)


def _watched(compile_it: Callable[..., Any], *arguments: Any) -> Any:
    with ExitStack() as stack:
        stack.enter_context(_no_collection())
        for watcher in _watchers:
            stack.enter_context(watcher())
        return compile_it(*arguments)


@contextmanager
def _no_collection() -> Iterator[None]:
    """Keep Python's garbage collector off: it takes a tenth of a cold start."""
    enabled = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if enabled:
            gc.enable()
