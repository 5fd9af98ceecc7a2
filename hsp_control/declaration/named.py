"""Parts by name: mappings in YAML, whose keys are the names."""

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import BeforeValidator

from hsp_control.common.exceptions import ConfigError
from hsp_control.declaration.located import within
from hsp_control.declaration.part import Part


def keyed(parts: Any) -> Any:
    """Return parts as a mapping by name; data of YAML with their keys as names.

    Raises:
        ConfigError: If data give a name beside the key.
        ValueError: If two have the same name.
    """
    if isinstance(parts, Mapping):
        return {key: with_name(key, each) for key, each in parts.items()}
    if isinstance(parts, str) or not isinstance(parts, Iterable) or is_plain(parts):
        return parts
    found: dict[str, Part] = {}
    for each in parts:
        name = getattr(each, "name", None)
        if name is None:
            raise ValueError(f"{each!r:.60} has no name")
        if name in found:
            raise ValueError(f"two are called {name!r}; give them distinct names")
        found[name] = each
    return found


def with_name(key: Any, entry: Any) -> Any:
    """Return the data of a part with their key as its name; other values as they are.

    Raises:
        ConfigError: If they give a name themselves.
    """
    if not isinstance(entry, dict):
        return entry
    if "name" in entry:
        with within(key, "name"):
            raise ConfigError(f"unknown key 'name'; the key {key!r} is the name")
    return {**entry, "name": key}


def is_plain(entries: Iterable[Any]) -> bool:
    """Return whether entries come from YAML, where parts by name are no list."""
    return isinstance(entries, list) and not any(
        isinstance(each, Part) for each in entries
    )


BY_NAME = BeforeValidator(keyed)
"""For a field that is a mapping by name: an iterable of parts will do as well."""
