"""Python functions that YAML names: those of a file that `import_file` has run."""

import sys
from collections.abc import Callable
from importlib.util import module_from_spec, spec_from_file_location
from inspect import isfunction
from pathlib import Path
from typing import Any

from pydantic import BeforeValidator, WithJsonSchema

from hsp_control.common.exceptions import ConfigError
from hsp_control.common.regular_file import why_no_file
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration.language import spoken

_functions: dict[str, Callable[..., Any]] = {}


def import_file(path: Path | str) -> None:
    """Run a Python file, whose functions and parts YAML can then name.

    ``{type: function_cost, function: elbow}`` names a function; a class such as ``class
    Sway(hsp.Cost, type="sway")`` declares a type. The file may do anything that Python
    can: import only what you trust.

    Raises:
        ConfigError: If the file cannot be read, or raises an error.
    """
    path = Path(path)
    spec = spec_from_file_location(path.stem, path)
    if not path.is_file() or spec is None or spec.loader is None:
        raise ConfigError(f"{path}: {why_no_file(path)}; needs a .py file")
    known = sys.modules.get(path.stem)
    if known is not None and known.__file__ != str(path):
        raise ConfigError(
            f"{path}: Python has another module {path.stem!r} already; rename the file"
        )
    module = sys.modules[path.stem] = module_from_spec(spec)
    try:
        spec.loader.exec_module(module)
    except Exception as error:
        del sys.modules[path.stem]
        raise ConfigError(f"{path}: {type(error).__name__}: {error}") from error
    found = vars(module).items()
    _functions.update((name, each) for name, each in found if isfunction(each))


def name_of(function: object) -> str | None:
    """Return the name that YAML has for a function; None: it has none."""
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
"""For a field that is a function: YAML gives its name; beside `AS_TEXT`."""
AS_TEXT = WithJsonSchema({"type": "string"})
"""How the JSON schema describes such a field."""
