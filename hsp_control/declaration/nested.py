"""Parts inside parts: in mappings by name, to find, replace or copy those of a kind."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from typing import Any, TypeVar

from pydantic import BeforeValidator

from hsp_control.common.errors import ConfigError
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


Kind = TypeVar("Kind", bound=Part)


def parts_within(value: Any, kind: type[Kind]) -> Iterator[Kind]:
    """Yield all parts of a kind inside a part, a mapping or a sequence, or itself."""
    if isinstance(value, kind):
        yield value
    elif isinstance(value, Part):
        yield from parts_within(value.all_fields(), kind)
    elif isinstance(value, Mapping):
        for each in value.values():
            yield from parts_within(each, kind)
    elif isinstance(value, tuple | list):
        for each in value:
            yield from parts_within(each, kind)


def with_parts_replaced(
    value: Any, kind: type[Kind], change: Callable[[Kind], Any]
) -> Any:
    """Return a value in which all parts of a kind are changed; the rest is kept."""
    if isinstance(value, kind):
        return change(value)
    if isinstance(value, Part):
        old = value.all_fields()
        new = with_parts_replaced(old, kind, change)
        changed = {name: new[name] for name in old if new[name] is not old[name]}
        return replace(value, **changed) if changed else value  # type: ignore[type-var]
    if isinstance(value, Mapping):
        made = {}
        for k, each in value.items():
            with within(k):
                made[k] = with_parts_replaced(each, kind, change)
        same = all(made[k] is each for k, each in value.items())
        return value if same else made
    if isinstance(value, tuple | list):
        items = []
        for k, each in enumerate(value):
            with within(k):
                items.append(with_parts_replaced(each, kind, change))
        same = all(a is b for a, b in zip(items, value, strict=True))
        return value if same else type(value)(items)
    return value


class Remembering(Part):
    """A part that is no value: it moves during a run, as a stream's reference.

    Only placed parts of a controller contain one. A deep copy continues independently.
    """
