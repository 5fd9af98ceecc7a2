"""Parts by name, or by frame: mappings in YAML, whose keys these are."""

from collections.abc import Iterable, Mapping
from functools import partial
from typing import Any, TypeVar

from pydantic import BeforeValidator

from hsp_control.common.exceptions import ConfigError
from hsp_control.declaration.located import within
from hsp_control.declaration.part import Part

Member = TypeVar("Member")


def keyed(parts: Any, field: str = "name") -> Any:
    """Return parts as a mapping by a field; data of YAML with their keys as it."""
    if isinstance(parts, Mapping):
        return {key: _with_key(key, each, field) for key, each in parts.items()}
    if isinstance(parts, str) or not isinstance(parts, Iterable):
        return parts
    parts = parts if isinstance(parts, list) else list(parts)
    if parts and not any(isinstance(each, Part) for each in parts):
        return parts  # of YAML, where parts by name are no list
    found: dict[str, Part] = {}
    for each in parts:
        key = getattr(each, field, None)
        if key is None:
            raise ValueError(f"{each!r:.60} has no {field}")
        if key in found:
            raise ValueError(f"two have the {field} {key!r}; give them distinct ones")
        found[key] = each
    return found


def _with_key(key: Any, entry: Any, field: str) -> Any:
    """Return the data of a part with their key as the field; others as they are."""
    if not isinstance(entry, dict):
        return entry
    if field in entry:
        with within(key, field):
            raise ConfigError(f"unknown key {field!r}; the key {key!r} is the {field}")
    return {**entry, field: key}


def stored(parts: Mapping[str, Member], field: str = "name") -> tuple[Member, ...]:
    """Return the parts of a mapping by a field."""
    for key, each in parts.items():
        if (own := getattr(each, field)) != key:
            raise ValueError(f"the one at {key!r} has another {field}, {own!r}")
    return tuple(parts.values())


BY_NAME = BeforeValidator(keyed)
"""For a field that is a mapping by name: an iterable of parts will do as well."""
BY_FRAME = BeforeValidator(partial(keyed, field="frame"))
"""The same by frame."""
stored_by_frame = partial(stored, field="frame")
