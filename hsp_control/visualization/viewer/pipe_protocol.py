"""The protocol of the pipe to the server's process: a stream of binary records.

The server's process imports this module too: it needs only the standard library.
"""

import struct
from collections.abc import Iterator
from typing import NamedTuple

SET, DELETE, ASK = 0, 1, 2
_HEAD = struct.Struct("<BII")  # kind, length of the name, length of the command


class Record(NamedTuple):
    """One record."""

    # ``SET`` a key, ``DELETE`` a path, or ``ASK`` whether a page shows all that was
    # sent.
    kind: int
    # The key, the path, or the request's number; a repeated request keeps its number.
    name: str
    packed: bytes = b""  # the command for the page


def encode(record: Record) -> bytes:
    """Return a record as bytes."""
    name = record.name.encode()
    return _HEAD.pack(record.kind, len(name), len(record.packed)) + name + record.packed


class Decoder:
    """Decodes records from a stream of bytes that arrives in pieces."""

    def __init__(self) -> None:
        """Start with an empty buffer."""
        self._rest = bytearray()

    def feed(self, data: bytes) -> Iterator[Record]:
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
            yield Record(kind, name, bytes(rest[middle:start]))
        del rest[:start]
