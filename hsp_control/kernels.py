"""The compiled route: small pure functions on arrays, which Numba compiles.

A *kernel* writes its results into arrays that the caller owns, allocates nothing, and
calls only other kernels. There is one implementation of each: with
``NUMBA_DISABLE_JIT=1`` the very same function runs as plain Python, for reading,
debugging and coverage.
"""

import hashlib
import warnings
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def _package_state() -> str:
    """Return a digest of the package's code: the same however it was installed."""
    state = hashlib.sha256()
    for file in sorted(Path(__file__).parent.rglob("*.py")):
        state.update(f"{file.name}\n".encode() + file.read_bytes())
    return state.hexdigest()[:12]


_PACKAGE_STATE = _package_state()


def kernel(function: Function) -> Function:
    """Compile ``function`` at its first call and keep the machine code on disk.

    Numba keeps code for as long as the function's own file does not change, though it
    has the code of kernels in other files inside. The name that it is kept under
    therefore tells the state of the whole package. It is kept beside the package's
    files, or where these are read-only in the user's cache folder; the environment
    variable ``NUMBA_CACHE_DIR`` names another. Where nothing can be written, every
    start compiles anew.

    It may return arrays to other kernels alone, not to Python.

    Division by zero follows NumPy (inf, nan) instead of raising, so that no branch is
    spent on it; finiteness is checked once, at the border (`RobotState.update`). Sums
    may be added in another order and products fused, or no sum would be vectorised:
    compiled and plain results differ by rounding.
    """
    function.__qualname__ += f"_{_PACKAGE_STATE}"
    # Without the reference counts of Numba's memory manager, handing over an array
    # costs 6 ns instead of 27, a slice nothing; and what allocates does not compile.
    options: dict[str, Any] = {
        "cache": True,
        "error_model": "numpy",
        "_nrt": False,
        "fastmath": {"reassoc", "contract"},
    }
    try:
        compiled = numba.njit(**options)(function)
    except RuntimeError as error:  # Numba found no folder to keep the code in
        if "cannot cache" not in str(error):
            raise
        _warn_of_no_cache()
        compiled = numba.njit(**(options | {"cache": False}))(function)
    return cast("Function", compiled)


def bind(
    function: Callable[..., Any], *arguments: Any, free: tuple[Any, ...] = ()
) -> Callable[..., Any]:
    """Return a call of a kernel with these very arguments, decided once.

    Each call of a compiled function looks its arguments' types up anew, which costs as
    much as handing them over or more: 0.14 of 0.2 µs for eight arrays. Arrays that stay
    have types that stay.

    Args:
        function: The kernel.
        arguments: Its first arguments. Arrays are followed, numbers stay as they are.
        free: Numbers of the types that the last arguments will have, which are left to
            the call.
    """
    if not hasattr(function, "overloads"):  # uncompiled
        return partial(function, *arguments)
    compiled = cast("Any", function)
    typeof = cast("Callable[[Any], Any]", numba.typeof)
    types = tuple(typeof(argument) for argument in (*arguments, *free))
    compiled.compile(types)
    return partial(compiled.overloads[types].entry_point, *arguments)


@cache
def _warn_of_no_cache() -> None:
    warnings.warn(
        "compiled code cannot be kept: neither the package's folder nor the user's "
        "cache can be written. Every start will take some ten seconds longer; set "
        "NUMBA_CACHE_DIR to a folder that can be written",
        RuntimeWarning,
        stacklevel=2,
    )
