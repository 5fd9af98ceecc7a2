"""The compiled route: small pure functions on arrays, which Numba compiles.

A *kernel* writes its results into arrays that the caller owns, allocates nothing, and
calls only other kernels. There is one implementation of each: with
``NUMBA_DISABLE_JIT=1`` the very same function runs as plain Python, for reading,
debugging and coverage.
"""

import hashlib
import warnings
from collections.abc import Callable
from functools import cache
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
    return cast("Function", compiled(numba.njit, function))


def compiled(
    by: Callable[..., Any], function: Callable[..., Any], *, keep: bool = True
) -> Any:
    """Return a function as ``by``, a decorator of Numba's, compiles it.

    Args:
        by: The decorator.
        function: The function.
        keep: Whether to keep the machine code on disk.
    """
    function.__qualname__ += f"_{_PACKAGE_STATE}"
    # Without the reference counts of Numba's memory manager, handing over an array
    # costs 6 ns instead of 27, a slice nothing; and what allocates does not compile.
    options: dict[str, Any] = {
        "cache": keep,
        "error_model": "numpy",
        "_nrt": False,
        "fastmath": {"reassoc", "contract"},
    }
    try:
        return by(**options)(function)
    except RuntimeError as error:  # Numba found no folder to keep the code in
        if "cannot cache" not in str(error):
            raise
        _warn_of_no_cache()
        return by(**(options | {"cache": False}))(function)


@cache
def _warn_of_no_cache() -> None:
    warnings.warn(
        "compiled code cannot be kept: neither the package's folder nor the user's "
        "cache can be written. Every start will take some ten seconds longer; set "
        "NUMBA_CACHE_DIR to a folder that can be written",
        RuntimeWarning,
        stacklevel=2,
    )
