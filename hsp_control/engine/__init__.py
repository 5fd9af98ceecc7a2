"""The engine: kinds of calls in C++, by name, and calls of them.

A kind is a struct of the folder ``engine`` in the sources: its members are its
arguments, its ``operator()`` is its mathematics. ``repr(engine.Circle)`` shows them.

The variable HSP_ENGINE selects another library than the installed one, such as one with
Eigen's assertions: ``python hatch_build.py Debug`` builds it.
"""

import os
import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any, TypeVar

Made = TypeVar("Made")


def _load(file: str) -> None:
    """Load a library in the place of the installed one."""
    name = f"{__name__}._engine"
    spec = spec_from_file_location(name, file)
    assert spec is not None
    assert spec.loader is not None
    sys.modules[name] = module = module_from_spec(spec)
    spec.loader.exec_module(module)


if _given := os.environ.get("HSP_ENGINE"):
    _load(_given)
try:
    from ._engine import BUILD as BUILD
    from ._engine import PINOCCHIO as PINOCCHIO
    from ._engine import Call as Call
    from ._engine import Dynamics as Dynamics
    from ._engine import Kind as Kind
    from ._engine import Move as Move
    from ._engine import Plan as Plan
    from ._engine import PythonCall as PythonCall
    from ._engine import Runnable as Runnable
    from ._engine import kinds as _kinds
    from ._engine import smooth_step as smooth_step
except ImportError as error:
    raise ImportError(
        f"the compiled part of hsp_control is missing or was built for another Python "
        f"({error}): install the package anew, with `pip install` or `make`"
    ) from error

LIBRARY: str = sys.modules[f"{__name__}._engine"].__file__ or ""
"""The file of the library in use."""
_BY_NAME = {kind.name: kind for kind in _kinds}


def kind(name: str) -> Kind:
    """Return the kind of this name.

    Raises:
        KeyError: If the engine has none.
    """
    return _BY_NAME[name]


def reduced(own: Kind) -> tuple[Callable[..., Kind], tuple[str, ...]]:
    """Return how a kind is rebuilt from a pickle; a user's own library is loaded."""
    if _BY_NAME.get(own.name) is own:
        return kind, (own.name,)
    from .own_kinds import library_of, of_library

    return of_library, (library_of(own), own.name)


def call(kind: Callable[..., Made], values: dict[str, Any]) -> Made:
    """Return a call of a kind with these arguments; copies and pickles use it."""
    return kind(**values)


def __getattr__(name: str) -> Kind:
    try:
        return _BY_NAME[name]
    except KeyError:
        raise AttributeError(f"the engine has no kind {name!r}") from None


def __dir__() -> list[str]:
    return sorted([*_BY_NAME, *(name for name in globals() if name[0] != "_")])
