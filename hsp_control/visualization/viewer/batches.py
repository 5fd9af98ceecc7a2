"""Commands in as few messages as may be: what moves together is shown together.

The server's process imports this too: it needs nothing but the standard library.
"""

import struct

_LARGEST = 1_000_000  # bytes; what moves the robot is far below


def batches(commands: list[bytes]) -> list[bytes]:
    """Return packed commands as arrays in MessagePack, each a message."""
    messages: list[bytes] = []
    batch: list[bytes] = []
    size = 0
    for packed in commands:
        if batch and size + len(packed) > _LARGEST:
            messages.append(_array(batch))
            batch, size = [], 0
        batch.append(packed)
        size += len(packed)
    return [*messages, _array(batch)] if batch else messages


def _array(batch: list[bytes]) -> bytes:
    return struct.pack(">BI", 0xDD, len(batch)) + b"".join(batch)
