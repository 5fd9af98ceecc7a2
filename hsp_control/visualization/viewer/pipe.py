"""What both processes of the view know: the latest commands, and the pipe's records.

The server's process imports this module too: it needs only the standard library.
"""

import json
import struct
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

_SEPARATOR = "\0"
_STAGE = {"Background", "camera", "caption", "floor", "lights"}


def key_of(path: str, name: str) -> str:
    """Return the key of a command that sets a property of a node."""
    return f"{path}{_SEPARATOR}{name}"


def newest(messages: Iterable[Mapping[str, Any]]) -> dict[str, Mapping[str, Any]]:
    """Return messages of a page, of each kind and object the newest, in their order."""
    found: dict[str, Mapping[str, Any]] = {}
    for message in messages:
        about = [message.get(name, "") for name in ("do", "target", "name", "id")]
        key = json.dumps(about)
        found.pop(key, None)  # the newest comes last
        found[key] = message
    return found


class LatestCommands:
    """Packed commands by key, oldest first: replayed in order they build the scene."""

    def __init__(self) -> None:
        """Start without commands."""
        self._packed: dict[str, bytes] = {}

    def put(self, key: str, packed: bytes) -> None:
        """Store a command in place of the last one with its key."""
        self._packed.pop(key, None)  # the new one comes last
        self._packed[key] = packed

    def drop(self, path: str) -> None:
        """Remove all commands of the node at a path and of the nodes below it."""
        below = f"{path}/"
        for key in list(self._packed):
            node = key.partition(_SEPARATOR)[0]
            if node == path or node.startswith(below):
                del self._packed[key]

    def pop_all(self) -> list[bytes]:
        """Return all packed commands, oldest first, and remove them."""
        packed = list(self._packed.values())
        self._packed.clear()
        return packed

    def items(self) -> list[tuple[str, str, bytes]]:
        """Return (path, property, packed command) of all commands, oldest first."""
        return [(*_split(key), packed) for key, packed in self._packed.items()]

    def get(self, key: str) -> bytes | None:
        """Return the packed command with a key, or None."""
        return self._packed.get(key)

    def copy(self) -> "LatestCommands":
        """Return an independent copy."""
        other = LatestCommands()
        other._packed = dict(self._packed)
        return other

    def stage(self) -> list[bytes]:
        """Return the packed commands that a page shows without waiting for meshes."""
        return [
            packed
            for path, name, packed in self.items()
            if name == "transform" or path.lstrip("/").partition("/")[0] in _STAGE
        ]

    def __len__(self) -> int:
        return len(self._packed)


def _split(key: str) -> tuple[str, str]:
    path, _, name = key.partition(_SEPARATOR)
    return path, name


SET, DELETE, ASK = 0, 1, 2
_HEAD = struct.Struct("<BII")  # kind, length of the name, length of the command


class PipeRecord(NamedTuple):
    """One record."""

    # ``SET`` a key, ``DELETE`` a path, or ``ASK`` whether a page shows all that was
    # sent.
    kind: int
    # The key, the path, or the request's number; a repeated request keeps its number.
    name: str
    packed: bytes = b""  # the command for the page


def encode(record: PipeRecord) -> bytes:
    """Return a record as bytes."""
    name = record.name.encode()
    return _HEAD.pack(record.kind, len(name), len(record.packed)) + name + record.packed


class Decoder:
    """Decodes records from a stream of bytes that arrives in pieces."""

    def __init__(self) -> None:
        """Start with an empty buffer."""
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[PipeRecord]:
        """Append bytes, and yield the records that are complete."""
        rest = self._rest
        rest += data
        start = 0
        while len(rest) - start >= _HEAD.size:
            kind, name_length, length = _HEAD.unpack_from(rest, start)
            middle = start + _HEAD.size + name_length
            if len(rest) < middle + length:
                break
            name = rest[start + _HEAD.size : middle].decode()
            start = middle + length
            yield PipeRecord(kind, name, bytes(rest[middle:start]))
        del rest[:start]
