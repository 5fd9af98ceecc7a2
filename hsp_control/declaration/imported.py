"""Python code of a user's own, whose functions and types YAML can name."""

import sys
from collections.abc import Callable, Iterable
from hashlib import sha256
from importlib import import_module
from importlib.machinery import PathFinder
from importlib.util import module_from_spec, spec_from_file_location
from inspect import isfunction
from pathlib import Path
from types import ModuleType
from typing import Any

from pydantic import BeforeValidator, WithJsonSchema

from hsp_control.common.errors import ConfigError
from hsp_control.common.regular_file import why_endless, why_no_file
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration.language import spoken

_functions: dict[str, Callable[..., Any]] = {}


def import_file(path: Path | str) -> None:
    """Run a Python file, whose functions and parts YAML can then name.

    ``{type: function_cost, function: elbow}`` names a function; a class such as ``class
    Sway(hsp.Cost, type="sway")`` declares a type. The file may do anything in Python:
    import only trusted files.

    Raises:
        ConfigError: If the file cannot be read, or raises an error.
    """
    path = Path(path)
    spec = spec_from_file_location(path.stem, path)
    ends = path.is_file() and not why_endless(path)
    if not ends or spec is None or spec.loader is None:
        raise ConfigError(f"{path}: {why_no_file(path)}; needs a .py file")
    known = sys.modules.get(path.stem)
    if known is not None and known.__file__ != str(path):
        raise ConfigError(
            f"{path}: Python has another module {path.stem!r} already; rename the file"
        )
    module = sys.modules[path.stem] = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except (Exception, SystemExit) as error:  # sys.exit() would end a run silently
        del sys.modules[path.stem]
        raise ConfigError(f"{path}: {type(error).__name__}: {error}") from error
    _take_functions(module)


def import_code(name: str) -> None:
    """Run a Python file, or import an installed module, unless it is known already.

    Args:
        name: The path of a ``.py`` file, or a module such as ``my_package.parts``.

    Raises:
        ConfigError: If there is no such code, or it raises an error.
    """
    if not is_file_name(name):
        try:
            _take_functions(import_module(name))
        except (Exception, SystemExit) as error:
            hint = f" (for a file, write {name}.py)" if isinstance(
                error, ModuleNotFoundError
            ) else ""  # fmt: skip
            raise ConfigError(
                f"the module {name!r} cannot be imported: "
                f"{type(error).__name__}: {error}{hint}"
            ) from error
        return
    path = Path(name)
    for known in (sys.modules.get(path.stem), sys.modules.get("__main__")):
        file = getattr(known, "__file__", None)
        if known is not None and file and path.exists() and path.samefile(file):
            _take_functions(known)
            return
    import_file(path)


def is_file_name(name: str) -> bool:
    """Return whether code is named by its file, and not as a module."""
    return name.endswith(".py") or "/" in name


def fingerprints(names: Iterable[str]) -> dict[str, str]:
    """Return the SHA-256 of the file of each named code; nothing is run."""
    found = {name: _file_of(name) for name in names}
    return {
        name: sha256(file.read_bytes()).hexdigest()
        for name, file in found.items()
        if file is not None and file.is_file()
    }


def _file_of(name: str) -> Path | None:
    """Return the file of code; the packages around a module are not imported."""
    if is_file_name(name):
        return Path(name)
    where, origin, parts = None, None, name.split(".")
    for k in range(len(parts)):
        spec = PathFinder.find_spec(".".join(parts[: k + 1]), where)
        if spec is None:
            return None
        where, origin = spec.submodule_search_locations, spec.origin
    return None if origin is None else Path(origin)


def _take_functions(module: ModuleType) -> None:
    found = vars(module).items()
    _functions.update((name, each) for name, each in found if isfunction(each))


def name_of(function: object) -> str | None:
    """Return the name of a function in YAML; None: it has none."""
    names = (name for name, each in _functions.items() if each is function)
    return next(names, None)


def _named(value: Any) -> Any:
    """Return the function that a name means; others as they are."""
    if not isinstance(value, str):
        return value
    if value not in _functions:
        there = f"there are {listing(_functions)}" if _functions else "there is none"
        unknown = (
            f"no function {value!r} was imported{did_you_mean(value, _functions)} "
            f"({there}); --import FILE.py runs the file that has it"
        )
        named = f"{value!r} is a str; needs the function itself"
        raise ValueError(spoken(unknown, named))
    return _functions[value]


NAMED = BeforeValidator(_named)
"""For a field that is a function: YAML gives its name; used with `AS_TEXT`."""
AS_TEXT = WithJsonSchema({"type": "string"})
"""How the JSON schema describes such a field."""
