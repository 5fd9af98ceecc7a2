"""The compiled route: small pure functions on arrays, which Numba compiles.

A *kernel* writes its results into arrays that the caller owns, allocates nothing, and
calls only other kernels. There is one implementation of each: with
``NUMBA_DISABLE_JIT=1`` the very same function runs as plain Python, for reading,
debugging and coverage.
"""

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def kernel(function: Function) -> Function:
    """Compile ``function`` at its first call and keep the machine code on disk.

    Division by zero follows NumPy (inf, nan) instead of raising, so that no branch is
    spent on it; finiteness is checked once, at the border (`RobotState.update`).
    """
    compiled = numba.njit(cache=True, error_model="numpy")(function)
    return cast("Function", compiled)
