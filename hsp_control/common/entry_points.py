"""Entry points: the additions of installed packages, and of this one's companions."""

from collections.abc import Callable
from functools import cache
from importlib import import_module, metadata
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).parents[1]


def entry_points(group: str) -> dict[str, EntryPoint]:
    """Return the additions to ``hsp_control.<group>``, by name.

    Companions whose folder was deleted add nothing, although the package's metadata
    still name them.
    """
    found = _installed().select(group=f"{_PACKAGE.name}.{group}")
    return {entry.name: entry for entry in found if _is_there(entry)}


@cache
def _installed() -> Any:
    """Return the entry points of all packages; reading their files takes 20 ms.

    Before Python 3.12 these are no `EntryPoints`, but have `select`, too.
    """
    return metadata.entry_points()


def is_ours(entry: EntryPoint) -> bool:
    """Return whether an entry point is one of this package's own."""
    return entry.module.partition(".")[0] == _PACKAGE.name


def _is_there(entry: EntryPoint) -> bool:
    place = _PACKAGE.parent.joinpath(*entry.module.split("."))
    files = place.with_suffix(".py"), place / "__init__.py"
    return not is_ours(entry) or any(file.is_file() for file in files)


def own_names(module: str) -> Callable[[], list[str]]:
    """Return a public module's ``__dir__``: its classes and functions, no imports.

    ``__dir__ = own_names(__name__)``. A package owns its imports from its modules;
    a file owns its definitions, or those that ``__all__`` lists.
    """

    def own(value: object, package: bool) -> bool:
        home = str(getattr(value, "__module__", ""))
        return home.startswith(f"{_PACKAGE.name}.") if package else home == module

    def names() -> list[str]:
        there = vars(import_module(module))
        package = "__path__" in there
        public = {
            k: each for k, each in there.items() if callable(each) and k[0] != "_"
        }
        mine = [k for k, each in public.items() if own(each, package)]
        return sorted({*there.get("__all__", mine)} - {own_names.__name__})

    return names
