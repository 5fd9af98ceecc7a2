"""The pages of all public names; autodoc renders their docstrings."""

import re
from collections.abc import Iterable
from importlib import import_module
from inspect import getdoc, isclass, isfunction
from types import ModuleType
from typing import Any

from plain_types import make_plain
from prose import plain

import hsp_control

_VALUES = {name: getattr(hsp_control, name) for name in dir(hsp_control)}
_SPACES = {
    **{
        name: value.__name__
        for name, value in _VALUES.items()
        if isinstance(value, ModuleType)
    },
    **{name: f"hsp_control.{name}" for name in ("control", "geometry")},
}
"""The namespaces, two rooms whose classes are at the top, and the companions."""


def names_page() -> str:
    """Return the page of the top-level names, with links to their namespaces' pages."""
    rows, homes = [], _homes()
    for name, value in _VALUES.items():
        if name in _SPACES or name == "__version__":
            continue
        path = homes.get(_home(value), _home(value))
        rows.append(f"| {{py:obj}}`hsp.{name} <{path}>` | {_summary(value)} |")
    spaces = [f"hsp.{name}" for name in sorted(_SPACES)]
    tree = "\n".join(spaces)
    return (
        "# Python\n\n`import hsp_control as hsp`. The most common names are in "
        "`hsp` itself; all others are in its namespaces.\n\n"
        "| name | |\n|---|---|\n" + "\n".join(rows) + "\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n:caption: Namespaces\n\n{tree}\n```\n"
    )


def _summary(value: Any) -> str:
    text = (getdoc(value) or "").split("\n\n")[0].replace("\n", " ").replace("|", "\\|")
    parts = text.split("`")  # every second one is code, in which nothing is escaped
    parts[::2] = [re.sub(r"([*_])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)


def namespace_pages() -> Iterable[tuple[str, str]]:
    """Return the pages of namespaces, with their names."""
    homes = _homes()
    for name, room in _SPACES.items():
        module = import_module(room)
        yield name, _namespace(name, module, homes)


def _homes() -> dict[str, str]:
    """Return the names under which classes and functions are described, once."""
    found: dict[str, str] = {}
    for room in _SPACES.values():
        module = import_module(room)
        for name, value in _public(module).items():
            found.setdefault(_home(value), f"{module.__name__}.{name}")
    return found


def _home(value: Any) -> str:
    names = (getattr(value, name, "") for name in ("__module__", "__qualname__"))
    return ".".join(names)


def _public(module: ModuleType) -> dict[str, Any]:
    """Return a namespace's own classes and functions, in alphabetical order."""
    is_room = hasattr(module, "__path__")  # whose public names come from its files
    found = {}
    for name in getattr(module, "__all__", None) or dir(module):
        value = getattr(module, name)
        home = getattr(value, "__module__", "")
        ours = home.startswith("hsp_control") if is_room else home == module.__name__
        if ours and not name.startswith("_") and (isclass(value) or isfunction(value)):
            found[name] = value
    return found


def _namespace(name: str, module: ModuleType, homes: dict[str, str]) -> str:
    lines = [f"# hsp.{name}", "", plain((getdoc(module) or "").split("\n\n")[0]), ""]
    for each, value in _public(module).items():
        path = f"{module.__name__}.{each}"
        home = homes[_home(value)]
        if home != path:
            lines += [f"{{py:obj}}`{each} <{home}>`: {_summary(value)}", ""]
            continue
        kind = "class" if isclass(value) else "function"
        lines += ["```{eval-rst}", f".. auto{kind}:: {path}"]
        make_plain(value)
        if isclass(value):
            _describe_arguments(value)
            lines += ["   :members:", f"   :exclude-members: {_overridden(value)}"]
            # Those of the files that one class is written in have no page.
            if (bases := _bases(value)) and not any(_home(b) in homes for b in bases):
                lines.append("   :inherited-members: Part, Declared")
        lines += ["```", ""]
    return "\n".join(lines)


def _describe_arguments(value: type) -> None:
    """Let a class describe its constructor's arguments, as a part does."""
    made: Any = value.__init__  # type: ignore[misc]
    if "Args:" in (made.__doc__ or "") and ".declaration." not in made.__module__:
        value.__doc__ = f"{getdoc(value)}\n\n{getdoc(made)}"


def _overridden(value: type) -> str:
    """Return the members that a base of ours documents already."""
    theirs = {name for base in _ours(value) for name in vars(base)}
    fields = set(vars(value).get("__annotations__", ()))
    return ", ".join(sorted(theirs & set(vars(value)) - fields)) or "model_config"


def _bases(value: type) -> list[type]:
    """Return the bases that a reader needs, not those of its declaration."""
    return [each for each in _ours(value) if ".declaration." not in each.__module__]


def _ours(value: type) -> list[type]:
    return [each for each in value.__mro__[1:] if each.__module__.startswith("hsp_")]
