"""Messages use the language of the user's input: YAML, or Python.

Python is the language by default: data of a text and the command line use YAML, in
which None is null, an array a list, and a part a mapping.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from itertools import islice
from typing import Any

import numpy as np

from hsp_control.common.errors import HspControlError
from hsp_control.common.suggestions import listing, nearest
from hsp_control.declaration.families import Declared, Family, value_fields

_WIDTH = 40
_ENTRIES = 8
_KINDS = {
    type(None): "nothing",
    bool: "a boolean",
    int: "an integer",
    float: "a decimal number",
    str: "text",
    list: "a list",
    dict: "a mapping",
}
_NAMESPACES = {
    "barriers": "limits",
    "drives": "plants",
    "estimators": "estimation",
    "orientations": "trajectories",
    "poses": "trajectories",
    "sensors": "plants",
}
"""The public namespace of a family, where its name differs from the family's."""
_OF_FUNCTIONS = {
    "fields": "FunctionField or FunctionCost",
    "orientations": "CallableOrientation",
    "trajectories": "CallableTrajectory",
}
"""The part that is made of a Python function, by the family."""

_IN_YAML: ContextVar[bool] = ContextVar("_IN_YAML", default=False)


@contextmanager
def in_yaml() -> Iterator[None]:
    """Within the block the input is YAML, or a command that contains YAML."""
    token = _IN_YAML.set(True)
    try:
        yield
    finally:
        _IN_YAML.reset(token)


def spoken(yaml: str, python: str) -> str:
    """Return the words in the language of the input."""
    return yaml if _IN_YAML.get() else python


def shown(value: Any) -> str:
    """Return the value as the user would type it, in one short line."""
    if _IN_YAML.get():
        return shortened(_flow(value, levels=3))
    if isinstance(value, Mapping) or not callable(value):
        return shortened(" ".join(repr(value).split()))
    return f"the function {getattr(value, '__name__', '')}".strip()


def shortened(text: str, width: int = _WIDTH) -> str:
    """Return the text, cut if it is longer than ``width``."""
    return text if len(text) <= width else f"{text[: width - 3]}..."


def kind(value: Any) -> str:
    """Return the kind of a value with its article, such as ``a list``."""
    if _IN_YAML.get():
        return _KINDS.get(type(value), f"of type {type(value).__name__}")
    return _with_article(type(value).__name__)


def joined(words: Sequence[str]) -> str:
    """Return ``a, b or c``."""
    return " or ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)


def check_kind(
    what: str, value: object, kind: type[Any], error: type[HspControlError]
) -> Any:
    """Return an argument that is an instance of a class; ``what`` begins the message.

    A bare value that means one will do as well; see `Declared.of_value`.
    """
    made = meant(value, [kind])
    if not isinstance(made, kind):
        raise error(f"{what} {misfit(value, [kind])}")
    return made


def meant(value: Any, kinds: Sequence[type[Any]]) -> Any:
    """Return the part that a bare value means in Python, or the value itself."""
    if value is None or isinstance(value, Declared | Mapping | str):
        return value
    families = [family for each in kinds if (family := getattr(each, "family", None))]
    for family in families:
        for member in family.members.values():
            if (found := member.of_value(value)) is not None:
                return found
    return value


def misfit(value: object, kinds: Sequence[type[Any]]) -> str:
    """Return the reason why a value is an instance of none of some classes."""
    if isinstance(value, type):
        return f"{value.__name__}, a class; give an instance, {value.__name__}(...)"
    families = [family for each in kinds if (family := getattr(each, "family", None))]
    return f"{_told(value)}; needs {joined([*map(_call, kinds)])}" + (
        _hint(value, families) if families else ""
    )


def _told(value: object) -> str:
    """Return the `repr` of a value if it is short, otherwise its kind."""
    if isinstance(value, np.ndarray):
        return f"an array of shape {value.shape}"
    if isinstance(value, Callable):  # type: ignore[arg-type]
        return shown(value)
    text, name = repr(value), _with_article(type(value).__name__)
    if value is None:
        return text
    readable = not (text.startswith("<") or "array(" in text or "\n" in text)
    return f"{shortened(text, 60)}, {name}" if readable else name


def _call(kind: type[Any]) -> str:
    """Return a class; of a part that is alone in its family, its constructor."""
    name = "None" if kind is type(None) else _with_article(kind.__name__)
    if not issubclass(kind, Declared) or kind.family is not None:
        return name
    return f"{name}({listing((each.name for each in value_fields(kind)), 6)})"


def _hint(value: object, families: Sequence[Family]) -> str:
    for family in families:
        place, members = _namespace(family), family.members
        if isinstance(value, str) and (near := nearest(value, members)):
            return f"; did you mean {place}.{members[near].__name__}(...)?"
        if callable(value) and (made := _OF_FUNCTIONS.get(family.name)):
            return f", such as {place}.{made} of it"
    if hasattr(value, "translation") and hasattr(value, "rotation"):
        return ": give its .translation or its .rotation"
    places = dict.fromkeys(map(_namespace, families))
    return f", one of {joined([*places])}"


def _namespace(family: Family) -> str:
    return f"hsp.{_NAMESPACES.get(family.name, family.name)}"


def _with_article(name: str) -> str:
    spelt = name[:2].isupper() and name[0] in "FHLMNRSX"  # an SE3
    return f"{'an' if spelt or name[0] in 'AEIOaeio' else 'a'} {name}"


def _flow(value: Any, levels: int) -> str:
    if isinstance(value, dict):
        pairs = [
            f"{key}: {_flow(entry, levels - 1)}"
            for key, entry in islice(value.items(), _ENTRIES if levels else 0)
        ]
        return f"{{{_entries(pairs, len(value))}}}"
    if isinstance(value, list | tuple):
        few = islice(value, _ENTRIES if levels else 0)
        entries = [_flow(entry, levels - 1) for entry in few]
        return f"[{_entries(entries, len(value))}]"
    if isinstance(value, str):
        return repr(shortened(value, _WIDTH - 2))
    if value is None or isinstance(value, bool):
        return {None: "null", True: "true", False: "false"}[value]
    if isinstance(value, float) and not math.isfinite(value):
        return ".nan" if math.isnan(value) else f"{'-' if value < 0 else ''}.inf"
    return repr(value)


def _entries(few: list[str], count: int) -> str:
    return ", ".join([*few, "..."] if count > len(few) else few)
