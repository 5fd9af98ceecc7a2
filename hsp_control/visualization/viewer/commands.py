"""What the page is told: Meshcat's commands and a few of our own, in MessagePack."""

import struct
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import umsgpack  # type: ignore[import-untyped]

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.kept import key_of

Json = dict[str, Any]

CAMERA, CAPTION, CLIP = "/camera", "/caption", "/clip"


class Command(NamedTuple):
    """One word to the page.

    Attributes:
        path: The node of the scene tree that it is about.
        key: What it sets; the next command with the same key replaces it.
        packed: The command itself, a map in MessagePack.
        deletes: Whether it takes the node and all below it away.
    """

    path: str
    key: str
    packed: bytes
    deletes: bool = False


def set_object(path: str, thing: Json) -> Command:
    """Put a thing (see `threejs`) at a path, in place of what was there."""
    return _command("set_object", path, "object", object=thing)


def set_transform(path: str, transform: Array) -> Command:
    """Move a node: its pose in its parent, a homogeneous matrix of shape (4, 4)."""
    matrix = np.ascontiguousarray(transform.T, dtype="<f8")
    return Command(
        path, key_of(path, "transform"), _transform_head(path) + matrix.tobytes()
    )


def set_property(path: str, name: str, value: Any) -> Command:
    """Set a property of a node: ``visible``, ``scale`` and what else Meshcat knows."""
    return _command("set_property", path, name, property=name, value=value)


def set_ghost(path: str, color: str, opacity: float) -> Command:
    """Make all that is at a node and below it a ghost, tinted in ``#RRGGBB``."""
    return _command("ghost", path, "ghost", color=color, opacity=float(opacity))


def set_trail(
    path: str,
    points: Array,
    radius: float,
    color: int,
    *,
    opacity: float = 1.0,
    sleeve: bool = False,
) -> Command:
    """Put a path in space at a node, in place of what was there.

    Args:
        path: The node.
        points: The path [m], shape (N, 3).
        radius: Half its thickness [m].
        color: Its colour as three.js's number, the same in any light.
        opacity: 1 solid, 0 invisible.
        sleeve: Show only the far half, seen from within: it never hides what it holds.
    """
    return _command(
        "trail",
        path,
        "object",
        points=typed_array(points, np.float32),
        radius=float(radius),
        color=color,
        opacity=float(opacity),
        sleeve=sleeve,
    )


def extend_trail(path: str, points: Array, number: int) -> Command:
    """Add points (N, 3) to a path's end; ``number`` counts how often that was done."""
    more = typed_array(points, np.float32)
    return _command("trail_more", path, f"more {number}", points=more)


def delete(path: str) -> Command:
    """Take away a node and all below it."""
    return _command("delete", path, "delete")._replace(deletes=True)


def set_camera(**view: Any) -> Command:
    """Look from elsewhere: see `Camera`."""
    return _command("camera", CAMERA, "camera", **view)


def set_caption(
    title: str, legend: list[tuple[str, str]], *, dark: bool = False
) -> Command:
    """Set the words beside the scene: a title, and names with their colours.

    Args:
        title: The title.
        legend: Names and colours ``#RRGGBB``.
        dark: Whether they stand on a dark background.
    """
    entries = [{"name": name, "color": color} for name, color in legend]
    return _command(
        "caption", CAPTION, "caption", title=title, legend=entries, dark=dark
    )


def set_time(text: str) -> Command:
    """Set the clock under the title; empty for none."""
    return _command("time", CAPTION, "time", text=text)


def set_status(text: str) -> Command:
    """Say beside the scene what the program is doing; empty for nothing."""
    return _command("status", CAPTION, "status", text=text)


def clip_command(kind: str, what: str, **fields: Any) -> Command:
    """Return a word about the clip: see `hsp_control.visualization.viewer.clip`."""
    return _command(kind, CLIP, what, **fields)


def forget_clip() -> Command:
    """Forget the clip and all that extended it, to make room for another or for none.

    A page that shows it goes on showing it until it is told what comes instead.
    """
    packed = umsgpack.packb({"type": "nothing", "path": CLIP})
    return Command(CLIP, key_of(CLIP, "nothing"), packed, deletes=True)


def seek(time: float) -> Command:
    """Have the page's player rest and show a time of its clip [s]."""
    return clip_command("seek", "seek", time=float(time))


def typed_array(values: Any, dtype: type[np.generic]) -> umsgpack.Ext:
    """Return numbers as one of JavaScript's typed arrays."""
    kinds: dict[Any, int] = {
        np.uint8: 0x12,
        np.uint32: 0x16,
        np.float32: 0x17,
        np.float64: 0x18,
    }
    return umsgpack.Ext(kinds[dtype], np.ascontiguousarray(values, dtype).tobytes())


def unpack(packed: bytes) -> Json:
    """Return a command as plain data, its typed arrays as arrays; for tests."""
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


def _command(kind: str, path: str, what: str, **fields: Any) -> Command:
    packed = umsgpack.packb({"type": kind, "path": path, **fields})
    return Command(path, key_of(path, what), packed)


@lru_cache(maxsize=4096)
def _transform_head(path: str) -> bytes:
    """Return the bytes before the matrix: packing them anew would cost the most."""
    head = b"".join(
        umsgpack.packb(word)
        for word in ("type", "set_transform", "path", path, "matrix")
    )
    ext8_of_16_doubles = struct.pack("BBB", 0xC7, 16 * 8, 0x18)
    return b"\x83" + head + ext8_of_16_doubles
