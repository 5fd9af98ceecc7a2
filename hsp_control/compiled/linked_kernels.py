"""Kernels that other kernels call: linked into their callers, never run themselves.

Numba makes each function ready to run: it optimises it, writes its machine code and a
wrapper for Python, and then optimises it again inside each function that calls it. Of a
kernel that is only called by kernels nothing but its code before all this is needed:
what calls it in the end optimises the whole. With `kernel_lowering` a cold start takes
a fifth of the time.
"""

from collections.abc import Callable
from copy import copy
from functools import cache
from typing import Any, cast

import numba
from llvmlite.binding import Linkage, newpassmanagers
from numba.core import codegen, compiler, compiler_machinery, registry, types

from hsp_control.compiled.kernel_lowering import KernelLowering

_target = cast("Any", registry).cpu_target
_Library = cast("Any", codegen).JITCodeLibrary
_LINEAR_ALGEBRA = "".join(f"{len(x)}{x}" for x in (*__name__.split(".")[:-1], "linalg"))
"""What names of functions of `linalg` contain in machine code."""


class _LinkedLibrary(_Library):  # type: ignore[misc,valid-type]
    """Code that is linked into other code, as it is."""

    def _optimize_functions(self, module: Any) -> None:
        """Leave that to the code that it is linked into."""
        module.data_layout = self._codegen._data_layout

    def finalize(self) -> None:
        """Make it ready for linking, and not for the machine."""
        self._finalized = True
        self._whole: Any = None

    def _get_module_for_linking(self) -> Any:
        """Return it with all that it calls: once, for code that is no part of other."""
        if self._whole is None:
            self._whole = self.own_module().clone()
            seen = {self}
            waiting = [*self._linking_libraries]
            while waiting:
                library = waiting.pop()
                if library in seen:
                    continue
                seen.add(library)
                if isinstance(library, _LinkedLibrary):
                    waiting += library._linking_libraries
                    module = library.own_module()
                else:
                    module = library._get_module_for_linking()
                self._whole.link_in(module, preserve=True)
        return self._whole

    def own_module(self) -> Any:
        """Return it without what it calls."""
        return super()._get_module_for_linking()


class _CallableLibrary(_Library):  # type: ignore[misc,valid-type]
    """Code that others call by its address."""

    def _optimize_functions(self, module: Any) -> None:
        """Leave that to the whole."""
        module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        """Optimise once; Numba does so twice, to remove counts that kernels lack.

        Loops are vectorised, but not interleaved: those of kernels are short. What has
        most of them, linear algebra, is called and not copied into each caller.

        Nothing else calls what is linked into it. LLVM is told so: it then removes
        arguments that are not read, and what it has inlined everywhere. Of an array's
        seven or more words, a call between kernels would else hand over all.

        Such a function gets a name of its own: when other code is loaded, its copy of
        the function, with all arguments, would else be taken for the same.
        """
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == Linkage.linkonce_odr:
                function.linkage = Linkage.internal
                function.name += ".internal"
                if _LINEAR_ALGEBRA in function.name:
                    function.add_function_attribute("noinline")
        tuning = newpassmanagers.create_pipeline_tuning_options(speed_level=1)
        tuning.loop_vectorization, tuning.loop_interleaving = True, False
        options = newpassmanagers.create_pass_builder(self._codegen._tm, tuning)
        options.getModulePassManager().run(self._final_module, options)


class _Passes(cast("Any", compiler_machinery).PassManager):  # type: ignore[misc]
    """Numba's passes, without timing them and analysing the code anew after each."""

    def _runPass(self, index: int, pss: Any, internal_state: Any) -> None:
        pss.analysis = self._analysis
        pss.run_initialization(internal_state)
        pss.run_pass(internal_state)
        pss.run_finalizer(internal_state)


class KernelCompiler(cast("Any", compiler).CompilerBase):  # type: ignore[misc]
    """Numba's compiler without the passes that find nothing in kernels."""

    def define_pipelines(self) -> list[Any]:
        """Return the passes."""
        if not _passes:
            whole = cast("Any", compiler).DefaultPassBuilder.define_nopython_pipeline
            manager = _Passes("kernel")
            for each, description in whole(self.state).passes:
                if each.__name__ not in _NEEDLESS:
                    lowers = each.__name__ == "NativeLowering"
                    manager.add_pass(KernelLowering if lowers else each, description)
            manager.finalize()
            _passes.append(manager)
        return _passes


_passes: list[_Passes] = []
_NEEDLESS = (
    "WithLifting", "InlineClosureLikes", "MakeFunctionToJitFunction",
    "InlineInlinables", "LiteralUnroll", "InlineOverloads", "NopythonRewrites",
    "AnnotateTypes", "DumpParforDiagnostics", "IRLegalization",
)  # fmt: skip


class _Flags(cast("Any", compiler).Flags):  # type: ignore[misc]
    """Options of a compilation that do not change: known by identity.

    Numba looks up what a call means by the options' values, of which there are thirty,
    and gathers them anew each time: a tenth of a cold start.
    """

    __slots__ = ()
    __eq__ = object.__eq__
    __hash__ = object.__hash__

    def copy(self) -> Any:
        return self


class _Typing(type(_target.typing_context)):  # type: ignore[misc]
    """Says what calls mean for the types of their arguments; asks Numba once."""

    def resolve_function_type(self, func: Any, args: Any, kws: Any) -> Any:
        """Return the signature of a call."""
        if kws or type(func) is not types.Function:
            return super().resolve_function_type(func, args, kws)
        key = func, *map(id, args)
        found = _meanings.get(key)
        if found is None:
            signature = super().resolve_function_type(func, args, kws)
            found = _meanings[key] = signature, args
        return found[0]


_meanings: dict[tuple[Any, ...], Any] = {}
"""Signatures by function and the types' identities; and the types, which are to live as
long."""


@cache
def _typing() -> _Typing:
    """Return Numba's context of types, with all it knows."""
    context = copy(_target.typing_context)
    context.__class__ = _Typing
    return cast("_Typing", context)


class _AddressStandIn:
    """Stands for a kernel's address, which it does not have."""


_all_flags: list[_Flags] = []


def _flags(dispatcher: Any) -> _Flags:
    """Return the options, the same object for all linked kernels."""
    if not _all_flags:
        flags = _Flags()
        own = dispatcher._compiler
        own.targetdescr.options.parse_as_flags(flags, own.targetoptions)
        flags.no_compile = True
        _all_flags.append(flags)
    return _all_flags[0]


def compile_callable(own: Any, function: Callable[..., Any], args: Any, to: Any) -> Any:
    """Return what Numba makes of a function that is called by its address."""
    flags = cast("Any", compiler).Flags()
    own.targetdescr.options.parse_as_flags(flags, own.targetoptions)
    target = _target.target_context
    library = _CallableLibrary(target.codegen(), function.__qualname__)
    library.enable_object_caching()  # its machine code is kept
    return cast("Any", compiler).compile_extra(
        _typing(),
        target,
        function,
        args=args,
        return_type=to,
        flags=own._customize_flags(flags),
        locals={},
        library=library,
        pipeline_class=KernelCompiler,
    )


def linked(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    """Return Numba's dispatcher of a function, for calls by compiled functions."""
    dispatcher: Any = cast("Any", numba).jit(
        **options, no_cpython_wrapper=True, no_cfunc_wrapper=True
    )(function)
    own = dispatcher._compiler
    flags = _flags(dispatcher)

    def compile_core(args: Any, return_type: Any) -> Any:
        target = _target.target_context
        result = cast("Any", compiler).compile_extra(
            _typing(),
            target,
            function,
            args=args,
            return_type=return_type,
            flags=flags,
            locals={},
            library=_LinkedLibrary(target.codegen(), function.__qualname__),
            pipeline_class=KernelCompiler,
        )
        # What calls it looks it up by this object.
        result = result._replace(entry_point=_AddressStandIn())
        target.insert_user_function(result.entry_point, result.fndesc, [result.library])
        return result

    def add_overload(result: Any) -> None:
        dispatcher.overloads[tuple(result.signature.args)] = result

    def get_call_template(args: Any, kws: Any) -> Any:
        # A number that is written in a call would be a type of its own.
        return with_types([unliteral(each) for each in args], kws)

    unliteral: Callable[[Any], Any] = types.unliteral
    with_types = dispatcher.get_call_template
    own._compile_core = compile_core
    dispatcher.get_call_template = get_call_template
    dispatcher.add_overload = add_overload
    return dispatcher
