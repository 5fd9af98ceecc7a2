"""Commands for the page, in MessagePack: Meshcat's and a few additional ones."""

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
import umsgpack  # type: ignore[import-untyped]

from hsp_control.common.arrays import Array
from hsp_control.common.unicode_text import encodable

Json = dict[str, Any]

CAMERA, CAPTION, CLIP, PLAY = "/camera", "/caption", "/clip", "/play"
PLOTS, MESHES = "/plots", "/meshes"
_SEPARATOR = "\0"
_STAGE = {"Background", "camera", "caption", "floor", "lights"}


def key_of(path: str, name: str) -> str:
    """Return the key of a command that sets a property of a node."""
    return f"{path}{_SEPARATOR}{name}"


class PageCommand(NamedTuple):
    """One command for the page."""

    path: str  # the node of the scene tree that it changes
    # The property that it sets, see `key_of`; a later command with the same key
    # replaces it.
    key: str
    packed: bytes  # the command itself, a map in MessagePack
    deletes: bool = False  # whether it deletes the node and all nodes below it


class LatestCommands:
    """Packed commands by key, oldest first: replayed in order they build the scene."""

    def __init__(self, packed: dict[str, bytes] | None = None) -> None:
        """Start without commands."""
        self._packed = packed or {}

    def keep(self, commands: Iterable[PageCommand], *, deletions: bool = False) -> None:
        """Store commands in place of the last ones with their keys.

        Those of a node that one deletes are dropped. With ``deletions`` it is stored
        itself, for a page that may show the node.
        """
        for command in commands:
            if command.deletes:
                self._drop(command.path)
            if command.path == MESHES and command.key in self._packed:
                continue  # the same file; the objects that use it come later
            self._packed.pop(command.key, None)  # the new command comes last
            if deletions or not command.deletes:
                self._packed[command.key] = command.packed

    def _drop(self, path: str) -> None:
        for key in list(self._packed):
            node = key.partition(_SEPARATOR)[0]
            if node == path or node.startswith(f"{path}/"):
                del self._packed[key]

    def pop_all(self) -> list[bytes]:
        """Return all packed commands, oldest first, and remove them."""
        packed = list(self._packed.values())
        self._packed.clear()
        return packed

    def items(self) -> list[tuple[str, str, bytes]]:
        """Return (path, property, packed command) of all commands, oldest first."""
        return [
            (path, name, packed)
            for key, packed in self._packed.items()
            for path, _, name in [key.partition(_SEPARATOR)]
        ]

    def get(self, key: str) -> bytes | None:
        """Return the packed command with a key, or None."""
        return self._packed.get(key)

    def copy(self) -> "LatestCommands":
        """Return an independent copy."""
        return LatestCommands(dict(self._packed))

    def stage(self) -> list[bytes]:
        """Return the packed commands that a page shows without waiting for meshes."""
        return [
            packed
            for path, name, packed in self.items()
            if name == "transform" or path.lstrip("/").partition("/")[0] in _STAGE
        ]

    def __len__(self) -> int:
        return len(self._packed)


class LegendEntry(NamedTuple):
    """One row of the legend, which is also a switch."""

    name: str
    color: str  # its colour, ``#RRGGBB`` or, if it is translucent, ``#RRGGBBAA``
    paths: tuple[str, ...]  # the nodes of the scene tree that the row shows and hides
    shown: bool = True  # whether they are shown at first
    # Whether the row is only a switch, since its object needs no explanation: films
    # leave it out.
    plain: bool = False
    # A short name: the switch is beside the views instead of in a separate row.
    short: str = ""
    key: str = ""  # the equivalent key of the keyboard, if any


def translucent(color: str, opacity: float) -> str:
    """Return ``#RRGGBB`` with an opacity from 0 to 1, as ``#RRGGBBAA``."""
    return f"{color}{round(255 * opacity):02X}"


def set_object(path: str, thing: Json) -> PageCommand:
    """Return the command that sets a node's object (see `threejs`)."""
    return page_command("set_object", path, "object", object=thing)


def set_transform(path: str, transform: Array) -> PageCommand:
    """Return the command that sets a node's pose in its parent, shape (4, 4)."""
    matrix = typed_array(transform.T, np.float64)
    return page_command("set_transform", path, "transform", matrix=matrix)


def set_property(path: str, name: str, value: Any) -> PageCommand:
    """Return the command that sets a property of a node, such as ``visible``."""
    return page_command("set_property", path, name, property=name, value=value)


def set_ghost(path: str, color: str, opacity: float) -> PageCommand:
    """Return the command that makes a node a ghost: tinted and translucent."""
    return page_command("ghost", path, "ghost", color=color, opacity=float(opacity))


def set_trail(
    path: str, points: Array, radius: float, color: int, *, sleeve: bool = False
) -> PageCommand:
    """Return the command that sets a node's object to a path in space, a tube."""
    return page_command(
        "trail",
        path,
        "object",
        points=typed_array(points, np.float32),
        radius=float(radius),
        color=color,
        sleeve=sleeve,
    )


def delete(path: str) -> PageCommand:
    """Return the command that deletes a node and all nodes below it."""
    return page_command("delete", path, "delete")._replace(deletes=True)


def set_caption(
    title: str, legend: list[LegendEntry], *, dark: bool = False
) -> PageCommand:
    """Return the command that sets the title and the legend beside the scene."""
    entries = [{**entry._asdict(), "paths": list(entry.paths)} for entry in legend]
    return page_command(
        "caption", CAPTION, "caption", title=title, legend=entries, dark=dark
    )


def set_time(text: str) -> PageCommand:
    """Return the command that sets the time below the title; "" hides it."""
    return page_command("time", CAPTION, "time", text=text)


def set_status(text: str) -> PageCommand:
    """Return the command that sets the program's status line; "" hides it."""
    return page_command("status", CAPTION, "status", text=text)


def forget_clip() -> PageCommand:
    """Return the command that removes the clip; an open page continues to play."""
    packed = pack({"type": "nothing", "path": CLIP})
    return PageCommand(CLIP, key_of(CLIP, "nothing"), packed, deletes=True)


def remove_plots() -> PageCommand:
    """Return the command that removes the plots, also from the scene."""
    return page_command("no_plots", PLOTS, "plots")._replace(deletes=True)


def typed_array(values: Any, dtype: type[np.generic]) -> umsgpack.Ext:
    """Return numbers as one of JavaScript's typed arrays."""
    kinds: dict[Any, int] = {
        np.uint8: 0x12,
        np.uint32: 0x16,
        np.float32: 0x17,
        np.float64: 0x18,
    }
    return umsgpack.Ext(kinds[dtype], np.ascontiguousarray(values, dtype).tobytes())


def pack(data: Json) -> bytes:
    """Return plain data in MessagePack; texts that name any file are `encodable`."""
    try:
        return bytes(umsgpack.packb(data))
    except UnicodeEncodeError:
        return bytes(umsgpack.packb(_encodable(data)))


def _encodable(data: Any) -> Any:
    if isinstance(data, str):
        return encodable(data)
    if isinstance(data, dict):
        return {_encodable(key): _encodable(value) for key, value in data.items()}
    if isinstance(data, list | tuple):
        return [_encodable(each) for each in data]
    return data


def unpack(packed: bytes) -> Json:
    """Return a command as plain data, its typed arrays as NumPy arrays."""
    kinds = {
        0x12: np.dtype("u1"),
        0x16: np.dtype("<u4"),
        0x17: np.dtype("<f4"),
        0x18: np.dtype("<f8"),
    }
    handlers = {
        kind: lambda ext, dtype=dtype: np.frombuffer(ext.data, dtype)
        for kind, dtype in kinds.items()
    }
    return dict(umsgpack.unpackb(packed, ext_handlers=handlers))


def page_command(kind: str, path: str, name: str, **fields: Any) -> PageCommand:
    """Return the command of a kind that sets a property of a node."""
    packed = pack({"type": kind, "path": path, **fields})
    return PageCommand(path, key_of(path, name), packed)


def path_element(name: str) -> str:
    """Return a name as one element of a path in the scene tree: without slashes."""
    return name.replace("/", "_") or "_"
