"""What was said last about each thing in the scene; the newer word replaces the older.

The server's process imports this too: it needs nothing but the standard library.
"""

_SEPARATOR = "\0"


def key_of(path: str, what: str) -> str:
    """Return the key of a command that sets ``what`` of the node at a path."""
    return f"{path}{_SEPARATOR}{what}"


class Kept:
    """Packed commands by key, oldest first.

    Replayed in order they build the whole scene, however long it has been moving: a
    page that opens late gets it, and one that is slow skips what is out of date.
    """

    def __init__(self) -> None:
        """Keep nothing yet."""
        self._packed: dict[str, bytes] = {}

    def put(self, key: str, packed: bytes) -> None:
        """Keep a command in place of the last one with its key."""
        self._packed.pop(key, None)  # the new one comes last
        self._packed[key] = packed

    def drop(self, path: str) -> None:
        """Forget all of the node at a path and of the nodes below it."""
        below = f"{path}/"
        for key in list(self._packed):
            node = key.partition(_SEPARATOR)[0]
            if node == path or node.startswith(below):
                del self._packed[key]

    def take(self) -> list[bytes]:
        """Return everything, oldest first, and keep nothing."""
        packed = list(self._packed.values())
        self._packed.clear()
        return packed

    def items(self) -> list[tuple[str, str, bytes]]:
        """Return (path, what, packed command) of everything, oldest first."""
        return [(*_split(key), packed) for key, packed in self._packed.items()]

    def get(self, key: str) -> bytes | None:
        """Return the command with a key, if there is one."""
        return self._packed.get(key)

    def copy(self) -> "Kept":
        """Return another that keeps the same."""
        other = Kept()
        other._packed = dict(self._packed)
        return other

    def __len__(self) -> int:
        return len(self._packed)


def _split(key: str) -> tuple[str, str]:
    path, _, what = key.partition(_SEPARATOR)
    return path, what
