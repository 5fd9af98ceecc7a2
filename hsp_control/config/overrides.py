"""Change one value of plain data, by a key path from the command line."""

import re
from typing import Any

from hsp_control.config.yaml_reader import MAX_DEPTH
from hsp_control.declaration.keys import KeyPath, written
from hsp_control.declaration.plain import shown


def assign(data: dict[str, Any], keys: list[str], value: Any) -> KeyPath:
    """Set the value at a key path, and return the key path.

    Missing keys of mappings are created (also in a mapping that was left empty); the
    schema then checks them. List entries are given by number and must exist.
    """
    if len(keys) > MAX_DEPTH:
        raise ValueError(f"nested deeper than {MAX_DEPTH} levels")
    holder: Any = data
    path: KeyPath = ()
    for key in keys[:-1]:
        place = _place(holder, key, path)
        inner = holder.get(place) if isinstance(holder, dict) else holder[place]
        if inner is None:
            inner = holder[place] = {}
        holder = inner
        path = (*path, place)
    last = _place(holder, keys[-1], path)
    holder[last] = value
    return (*path, last)


def _place(holder: Any, key: str, path: KeyPath) -> str | int:
    """Return ``key`` for a mapping, or the number of the entry for a list."""
    if isinstance(holder, dict):
        return key
    if not isinstance(holder, list):
        raise ValueError(f"{written(path)} is {shown(holder)}, which has no keys")
    if not re.fullmatch(r"[0-9]{1,6}", key) or int(key) >= len(holder):
        entries = f"0 to {len(holder) - 1}" if holder else "none"
        raise ValueError(f"{written(path)} has no entry {key!r} (entries: {entries})")
    return int(key)
