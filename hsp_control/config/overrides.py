"""Change one value of plain data, by a key path as it is typed on a command line."""

import re
from typing import Any

from hsp_control.config.keys import KeyPath, written
from hsp_control.config.plain import shown
from hsp_control.config.yaml_reader import MAX_DEPTH


def assign(data: dict[str, Any], keys: list[str], value: Any) -> KeyPath:
    """Put ``value`` where the keys lead, and return the key path of that place.

    Missing keys of mappings are created (a mapping that was left empty, too), so that
    the schema judges them; entries of lists are named by number and must exist.

    Raises:
        ValueError: If there is no such place; the data is then unchanged.
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
    """Return the key, or the number of the list's entry, that ``key`` names.

    Raises:
        ValueError: If the holder, which stands at ``path``, has no such place.
    """
    if isinstance(holder, dict):
        return key
    if not isinstance(holder, list):
        raise ValueError(f"{written(path)} is {shown(holder)}, which has no keys")
    if not re.fullmatch(r"[0-9]{1,6}", key) or int(key) >= len(holder):
        entries = f"0 to {len(holder) - 1}" if holder else "none"
        raise ValueError(f"{written(path)} has no entry {key!r} (entries: {entries})")
    return int(key)
