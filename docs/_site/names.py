"""The pages of all public names; autodoc writes what is in their docstrings."""

from collections.abc import Iterable
from importlib import import_module
from inspect import getdoc, isclass, isfunction
from types import ModuleType
from typing import Any

from plain_types import make_plain
from prose import plain

import hsp_control

_SPACES = {**hsp_control._NAMESPACES, "control": "control", "geometry": "geometry"}
"""The namespaces, and two rooms whose classes are at the top."""


def names_page() -> str:
    """Return the page of the names at the top, each a link to its namespace's page."""
    rows = []
    for name, room in hsp_control._HOMES.items():
        value = getattr(hsp_control, name)
        path = f"hsp_control.{room}.{name}"
        rows.append(f"| {{py:obj}}`hsp.{name} <{path}>` | {_summary(value)} |")
    spaces = [f"hsp.{name}" for name in sorted(_SPACES)]
    tree = "\n".join(spaces)
    return (
        "# Python\n\n`import hsp_control as hsp`. What most programs need is in "
        "`hsp` itself; all others are in its namespaces.\n\n"
        "| name | |\n|---|---|\n" + "\n".join(rows) + "\n\n"
        f"```{{toctree}}\n:maxdepth: 1\n:caption: Namespaces\n\n{tree}\n```\n"
    )


def _summary(value: Any) -> str:
    text = (getdoc(value) or "").split("\n\n")[0].replace("\n", " ")
    return text.replace("|", "\\|").replace("*", "\\*").replace("_", "\\_")


def namespace_pages() -> Iterable[tuple[str, str]]:
    """Return the page of each namespace, with its name."""
    written: dict[str, str] = {}
    for name, room in _SPACES.items():
        module = import_module(f"hsp_control.{room}")
        yield name, _namespace(name, module, written)


def _public(module: ModuleType) -> dict[str, Any]:
    """Return a namespace's own classes and functions, in alphabetical order."""
    is_room = hasattr(module, "__path__")  # whose public names come from its files
    found = {}
    for name in sorted(getattr(module, "__all__", None) or vars(module)):
        value = getattr(module, name)
        home = getattr(value, "__module__", "")
        ours = home.startswith("hsp_control") if is_room else home == module.__name__
        if ours and not name.startswith("_") and (isclass(value) or isfunction(value)):
            found[name] = value
    return found


def _namespace(name: str, module: ModuleType, written: dict[str, str]) -> str:
    lines = [f"# hsp.{name}", "", plain((getdoc(module) or "").split("\n\n")[0]), ""]
    for each, value in _public(module).items():
        path = f"{module.__name__}.{each}"
        home = f"{value.__module__}.{value.__qualname__}"
        if written.setdefault(home, path) != path:
            lines += [f"{{py:obj}}`{each} <{written[home]}>`: {_summary(value)}", ""]
            continue
        kind = "class" if isclass(value) else "function"
        lines += ["```{eval-rst}", f".. auto{kind}:: {path}"]
        if isclass(value):
            make_plain(value)
            lines += ["   :members:", f"   :exclude-members: {_overridden(value)}"]
        lines += ["```", ""]
    return "\n".join(lines)


def _overridden(value: type) -> str:
    """Return the members that a base of ours documents already."""
    bases = [each for each in value.__mro__[1:] if each.__module__.startswith("hsp_")]
    theirs = {name for base in bases for name in vars(base)}
    fields = set(vars(value).get("__annotations__", ()))
    return ", ".join(sorted(theirs & set(vars(value)) - fields)) or "model_config"
