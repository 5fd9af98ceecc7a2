"""Parts by frame: mappings in YAML, whose keys are the names of frames."""

from collections.abc import Iterable, Mapping
from typing import Any, Protocol, TypeVar

from pydantic import BeforeValidator

from hsp_control.common.exceptions import ConfigError
from hsp_control.declaration import within
from hsp_control.declaration.named import is_plain


class _AtFrame(Protocol):
    @property
    def frame(self) -> str: ...


T = TypeVar("T", bound=_AtFrame)


def keyed(parts: Any) -> Any:
    """Return parts as a mapping by frame; data of YAML with their keys as frames.

    Raises:
        ConfigError: If data give a frame beside the key.
        ValueError: If two have the same frame.
    """
    if isinstance(parts, Mapping):
        return {key: _with_frame(key, each) for key, each in parts.items()}
    if isinstance(parts, str) or not isinstance(parts, Iterable):
        return parts
    parts = list(parts)
    if parts and is_plain(parts):
        return parts
    found: dict[str, Any] = {}
    for each in parts:
        if (frame := getattr(each, "frame", None)) is None:
            raise ValueError(f"{each!r:.60} has no frame")
        if frame in found:
            raise ValueError(f"two have the same frame {frame!r}")
        found[frame] = each
    return found


def stored(parts: Mapping[str, T]) -> tuple[T, ...]:
    """Return the parts of a mapping by frame.

    Raises:
        ValueError: If a part's frame is not its key.
    """
    for key, each in parts.items():
        if each.frame != key:
            raise ValueError(f"the one at {key!r} has another frame, {each.frame!r}")
    return tuple(parts.values())


def _with_frame(key: Any, entry: Any) -> Any:
    if not isinstance(entry, dict):
        return entry
    if "frame" in entry:
        with within(key, "frame"):
            raise ConfigError(f"unknown key 'frame'; the key {key!r} is the frame")
    return {**entry, "frame": key}


BY_FRAME = BeforeValidator(keyed)
"""For a field that is a mapping by frame: an iterable of parts will do as well."""
