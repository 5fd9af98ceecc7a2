"""Packs many commands into few messages, so that the page shows them together.

The server's process imports this module too: it needs only the standard library.
"""

import struct

_MAX_SIZE = 1_000_000  # bytes; the commands that move a robot are far smaller


def batch_messages(commands: list[bytes]) -> list[bytes]:
    """Return packed commands as messages, each an array in MessagePack."""
    messages: list[bytes] = []
    batch: list[bytes] = []
    size = 0
    for packed in commands:
        if batch and size + len(packed) > _MAX_SIZE:
            messages.append(_array(batch))
            batch, size = [], 0
        batch.append(packed)
        size += len(packed)
    return [*messages, _array(batch)] if batch else messages


def _array(batch: list[bytes]) -> bytes:
    return struct.pack(">BI", 0xDD, len(batch)) + b"".join(batch)
