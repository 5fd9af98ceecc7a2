"""Parts by name: mappings in YAML, whose keys are the names."""

from collections.abc import Iterable, Mapping
from typing import Any

from pydantic import BeforeValidator

from hsp_control.declaration.part import Part


def keyed(parts: Any) -> Any:
    """Return parts as a mapping by name; data of YAML with their keys as names.

    Raises:
        ValueError: If two have the same name.
    """
    if isinstance(parts, Mapping):
        return {
            key: {**each, "name": key} if isinstance(each, dict) else each
            for key, each in parts.items()
        }
    if isinstance(parts, str) or not isinstance(parts, Iterable):
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


BY_NAME = BeforeValidator(keyed)
"""For a field that is a mapping by name: an iterable of parts will do as well."""
