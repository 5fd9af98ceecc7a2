"""Plain data in messages: written as YAML, cut to one line, and named by its kind."""

import math
from itertools import islice
from typing import Any

_WIDTH = 40
_ENTRIES = 8


def shown(value: Any) -> str:
    """Return the value as YAML, in one short line."""
    return shortened(_flow(value, levels=3))


def shortened(text: str, width: int = _WIDTH) -> str:
    """Return the text, cut if it is longer than ``width``."""
    return text if len(text) <= width else f"{text[: width - 3]}..."


def kind(value: Any) -> str:
    """Return the kind of a value with its article, such as ``a list``."""
    kinds = {
        type(None): "nothing",
        bool: "a boolean",
        int: "an integer",
        float: "a decimal number",
        str: "text",
        list: "a list",
        dict: "a mapping",
    }
    return kinds.get(type(value), f"of type {type(value).__name__}")


def joined(words: list[str]) -> str:
    """Return ``a, b or c``."""
    return " or ".join(part for part in (", ".join(words[:-1]), *words[-1:]) if part)


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
