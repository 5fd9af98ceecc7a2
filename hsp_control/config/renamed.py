"""Keys that have a new name: configurations and logs of earlier versions still load."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from hsp_control.declaration.keys import KeyPath, written
from hsp_control.declaration.located import located


class Renamed(NamedTuple):
    """A key that has a new name.

    A ``*`` in the old path matches any one key or list entry. The new path has as many
    ``*``; they take, in order, what those of the old path matched.

    Attributes:
        old: The old key path.
        new: The new key path.
        type: Only where the mapping that holds the key has this ``type``; None: in all.
    """

    old: KeyPath
    new: KeyPath
    type: str | None = None


_ORIENTATIONS: tuple[KeyPath, ...] = (
    ("tasks", "*", "trajectory"),
    ("tasks", "*", "trajectory", "orientation"),
    ("scene", "obstacles", "*", "orientation"),
)

_PLACEMENTS: tuple[KeyPath, ...] = (
    ("robot", "tool_frames", "*"),
    ("robot", "parts", "*"),
    ("robot", "parts", "*", "tool_frames", "*"),
    ("plant", "robot", "tool_frames", "*"),
)

RENAMED = (
    Renamed(("remedies",), ("compensation",)),
    Renamed(
        ("limits", "distances", "*", "least"), ("limits", "distances", "*", "minimum")
    ),
    Renamed(("plant", "contacts", "*", "rpy"), ("plant", "contacts", "*", "rotation")),
    *(Renamed((*at, "rpy"), (*at, "rotations"), "path") for at in _ORIENTATIONS),
    *(Renamed((*at, "rpy"), (*at, "rotation")) for at in _ORIENTATIONS + _PLACEMENTS),
)
"""All keys that have a new name; of two that fit, the first counts."""

UNUSED = (
    Renamed(("tasks", "*", "gains"), (), "angular_momentum"),  # it is of first order
)
"""Keys that had no effect, and are gone."""

_NESTED = dict, list


class RenamedKeyWarning(FutureWarning):
    """A configuration uses the old name of a key."""


def rename_keys(
    data: dict[str, Any],
    origins: dict[KeyPath, Any],
    location: Callable[[KeyPath], str],
) -> None:
    """Give renamed keys their new names, remove unused ones, and warn about each.

    Args:
        data: The configuration; changed in place.
        origins: Where each key path comes from; changed in place, so that the values
            under a renamed key keep their lines.
        location: Returns ``file:line`` of a key path, for messages.

    Raises:
        ConfigError: If the old and the new key are both given.
    """
    for pattern, _, kind in UNUSED:
        for path in list(_matches(data, pattern)):
            if _get(data, (*path[:-1], "type")) == kind:
                _warn(location(path), f"{written(path)} has no effect; remove it")
                del _get(data, path[:-1])[path[-1]]
    for old_pattern, new_pattern, kind in RENAMED:
        for old in list(_matches(data, old_pattern)):
            if kind is not None and _get(data, (*old[:-1], "type")) != kind:
                continue
            new = _new_path(old_pattern, new_pattern, old)
            holders = [_get(data, new[:k]) for k in range(len(new))]
            if isinstance(holders[-1], dict) and new[-1] in holders[-1]:
                message = (
                    f"is now {written(new)}, which is also given; remove one of them"
                )
                raise located(location(old), message, old)
            if not all(
                holder is None or isinstance(holder, _NESTED) for holder in holders
            ):
                continue  # the new place cannot exist: the schema reports what is wrong
            _warn(location(old), f"{written(old)} is now {written(new)}")
            _move(data, old, new)
            for path in [path for path in origins if path[: len(old)] == old]:
                origins[(*new, *path[len(old) :])] = origins.pop(path)


def current_keys(
    keys: Sequence[str], where: str, data: dict[str, Any] | None = None
) -> list[str]:
    """Return the parts of a key path with their new names; warn if one is renamed.

    Args:
        keys: The parts, as text: those of ``--set`` or ``--over``.
        where: The file and line, or the option, for the warning.
        data: The configuration; without it, a key whose new name depends on a type
            keeps its old name.
    """
    current: KeyPath = tuple(keys)
    for old_pattern, new_pattern, kind in RENAMED:
        old = current[: len(old_pattern)]
        if not _fits(old, old_pattern):
            continue
        if kind is not None:
            if data is None:
                break
            if _get(data, (*old[:-1], "type")) != kind:
                continue
        new = _new_path(old_pattern, new_pattern, old)
        _warn(where, f"{written(old)} is now {written(new)}")
        current = (*new, *current[len(old) :])
    return [str(part) for part in current]


def _warn(where: str, message: str) -> None:
    warnings.warn(f"{where}: {message}", RenamedKeyWarning, stacklevel=4)


def _fits(path: KeyPath, pattern: KeyPath) -> bool:
    return len(path) == len(pattern) and all(
        wanted in ("*", part) for part, wanted in zip(path, pattern, strict=True)
    )


def _new_path(old_pattern: KeyPath, new_pattern: KeyPath, old: KeyPath) -> KeyPath:
    """Return the new key path, with the parts that each ``*`` matched."""
    matched = (
        part for part, wanted in zip(old, old_pattern, strict=True) if wanted == "*"
    )
    return tuple(next(matched) if part == "*" else part for part in new_pattern)


def _matches(value: Any, pattern: KeyPath, path: KeyPath = ()) -> Iterator[KeyPath]:
    """Yield the key paths in the data that match a pattern."""
    if not pattern:
        yield path
    elif isinstance(value, _NESTED):
        entries = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inner in entries:
            if pattern[0] in ("*", key):
                yield from _matches(inner, pattern[1:], (*path, key))


def _get(data: Any, path: KeyPath) -> Any:
    """Return the value at a key path, None if there is none."""
    for part in path:
        if isinstance(data, list) and str(part).isdecimal():
            data = data[int(part)] if int(part) < len(data) else None
        else:
            data = data.get(part) if isinstance(data, dict) else None
    return data


def _move(data: dict[str, Any], old: KeyPath, new: KeyPath) -> None:
    """Move a value, creating the mappings that lead to its new place."""
    value = _get(data, old[:-1]).pop(old[-1])
    holder: Any = data
    for part in new[:-1]:
        if _get(holder, (part,)) is None:
            holder[part] = {}
        holder = holder[part]
    holder[new[-1]] = value
