"""Kernels that other kernels call: linked into their callers, never run themselves.

Numba makes each function ready to run: it optimises it, writes its machine code and a
wrapper for Python, and then optimises it again inside each function that calls it. Of a
kernel that is only called by kernels nothing but its code before all this is needed:
what calls it in the end optimises the whole. This halves the time of a cold start.
"""

from collections.abc import Callable
from typing import Any, cast

import numba
from numba.core import codegen, compiler, registry

_target = cast("Any", registry).cpu_target
_Library = cast("Any", codegen).JITCodeLibrary


class _LinkedLibrary(_Library):  # type: ignore[misc,valid-type]
    """Code that is linked into other code, as it is."""

    def _optimize_functions(self, module: Any) -> None:
        """Leave that to the code that it is linked into."""
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        """Leave that, too."""

    def _finalize_final_module(self) -> None:
        """Make it ready for linking, and not for the machine."""
        self._finalized = True


class _Entry:
    """Stands for a kernel's address, which it does not have."""


def linked(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return Numba's dispatcher of a function, for calls by other compiled functions.

    Args:
        function: The function.
        options: Numba's options.
    """
    dispatcher: Any = cast("Any", numba).jit(
        **options, no_cpython_wrapper=True, no_cfunc_wrapper=True
    )(function)
    own = dispatcher._compiler

    def compile_core(args: Any, return_type: Any) -> Any:
        target = _target.target_context
        flags = cast("Any", compiler).Flags()
        own.targetdescr.options.parse_as_flags(flags, own.targetoptions)
        flags.no_compile = True
        result = cast("Any", compiler).compile_extra(
            _target.typing_context,
            target,
            function,
            args=args,
            return_type=return_type,
            flags=flags,
            locals={},
            library=_LinkedLibrary(target.codegen(), function.__qualname__),
        )
        # What calls it looks it up by this object.
        result = result._replace(entry_point=_Entry())
        target.insert_user_function(result.entry_point, result.fndesc, [result.library])
        return result

    def add_overload(result: Any) -> None:
        dispatcher.overloads[tuple(result.signature.args)] = result

    own._compile_core = compile_core
    dispatcher.add_overload = add_overload
    return dispatcher
