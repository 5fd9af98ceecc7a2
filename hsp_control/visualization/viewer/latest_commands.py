"""The latest command for each key of the scene: a newer command replaces an older one.

The server's process imports this module too: it needs only the standard library.
"""

_SEPARATOR = "\0"
_STAGE = {"Background", "camera", "caption", "floor", "lights"}


def key_of(path: str, name: str) -> str:
    """Return the key of a command that sets a property of a node."""
    return f"{path}{_SEPARATOR}{name}"


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

    def take(self) -> list[bytes]:
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
