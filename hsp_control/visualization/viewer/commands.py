"""Commands for the page, in MessagePack: Meshcat's and a few additional ones."""

import struct
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import umsgpack  # type: ignore[import-untyped]

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.pipe import LatestCommands, key_of

Json = dict[str, Any]

CAMERA, CAPTION, CLIP, PLAY = "/camera", "/caption", "/clip", "/play"
PLOTS = "/plots"


class PageCommand(NamedTuple):
    """One command for the page."""

    path: str  # the node of the scene tree that it changes
    # The property that it sets, see `key_of`; a later command with the same key
    # replaces it.
    key: str
    packed: bytes  # the command itself, a map in MessagePack
    deletes: bool = False  # whether it deletes the node and all nodes below it

    def keep_in(self, scene: LatestCommands) -> None:
        """Store it in a scene, or remove there what it deletes."""
        if self.deletes:
            scene.drop(self.path)
        else:
            scene.put(self.key, self.packed)


class LegendEntry(NamedTuple):
    """One row of the legend, and the switch of what it names."""

    name: str
    color: str  # its colour, ``#RRGGBB`` or, if it is translucent, ``#RRGGBBAA``
    paths: tuple[str, ...]  # the nodes of the scene tree that the row shows and hides
    shown: bool = True  # whether they are shown at first
    # Whether the row is only a switch, as what it names explains itself: films leave it
    # out.
    plain: bool = False


def translucent(color: str, opacity: float) -> str:
    """Return ``#RRGGBB`` with an opacity from 0 to 1, as ``#RRGGBBAA``."""
    return f"{color}{round(255 * opacity):02X}"


def set_object(path: str, thing: Json) -> PageCommand:
    """Return the command that sets a node's object (see `threejs`)."""
    return _command("set_object", path, "object", object=thing)


def set_transform(path: str, transform: Array) -> PageCommand:
    """Return the command that sets a node's pose in its parent, shape (4, 4)."""
    matrix = np.ascontiguousarray(transform.T, dtype="<f8")
    return PageCommand(
        path, key_of(path, "transform"), _transform_head(path) + matrix.tobytes()
    )


def set_property(path: str, name: str, value: Any) -> PageCommand:
    """Return the command that sets a property of a node, such as ``visible``."""
    return _command("set_property", path, name, property=name, value=value)


def set_ghost(path: str, color: str, opacity: float) -> PageCommand:
    """Return the command that makes a node a ghost: tinted and translucent."""
    return _command("ghost", path, "ghost", color=color, opacity=float(opacity))


def set_trail(
    path: str, points: Array, radius: float, color: int, *, sleeve: bool = False
) -> PageCommand:
    """Return the command that sets a node's object to a path in space, a tube."""
    return _command(
        "trail",
        path,
        "object",
        points=typed_array(points, np.float32),
        radius=float(radius),
        color=color,
        sleeve=sleeve,
    )


def extend_trail(path: str, points: Array, number: int) -> PageCommand:
    """Return the command that appends points to a path; points (N, 3) [m]."""
    more = typed_array(points, np.float32)
    return _command("trail_more", path, f"more {number}", points=more)


def set_length_label(path: str) -> PageCommand:
    """Return the command that labels a bar along z with its length [m]."""
    return _command("length_label", path, "length label")


def delete(path: str) -> PageCommand:
    """Return the command that deletes a node and all nodes below it."""
    return _command("delete", path, "delete")._replace(deletes=True)


def set_camera(**view: Any) -> PageCommand:
    """Return the command that places the camera: see `look_at`."""
    return _command("camera", CAMERA, "camera", **view)


def set_caption(
    title: str, legend: list[LegendEntry], *, dark: bool = False
) -> PageCommand:
    """Return the command that sets the title and the legend beside the scene."""
    entries = [{**entry._asdict(), "paths": list(entry.paths)} for entry in legend]
    return _command(
        "caption", CAPTION, "caption", title=title, legend=entries, dark=dark
    )


def set_time(text: str) -> PageCommand:
    """Return the command that sets the time below the title; "" hides it."""
    return _command("time", CAPTION, "time", text=text)


def set_status(text: str) -> PageCommand:
    """Return the command that sets the program's status line; "" hides it."""
    return _command("status", CAPTION, "status", text=text)


def clip_command(kind: str, name: str, **fields: Any) -> PageCommand:
    """Return a command for the clip: see `hsp_control.visualization.viewer.clip`."""
    return _command(kind, CLIP, name, **fields)


def play_command(kind: str, name: str, **fields: Any) -> PageCommand:
    """Return a command for a page that is played with: see `hsp_control.play`."""
    return _command(kind, PLAY, name, **fields)


def forget_clip() -> PageCommand:
    """Return the command that drops the clip from the scene; a page still plays on."""
    packed = umsgpack.packb({"type": "nothing", "path": CLIP})
    return PageCommand(CLIP, key_of(CLIP, "nothing"), packed, deletes=True)


def set_plots(plots: Json, arrays: list[Json]) -> PageCommand:
    """Return the command that shows plots in place of earlier ones."""
    return _command("plots", PLOTS, "plots", plots=plots, arrays=arrays)


def remove_plots() -> PageCommand:
    """Return the command that removes the plots, also from the scene."""
    return _command("no_plots", PLOTS, "plots")._replace(deletes=True)


def seek(time: float) -> PageCommand:
    """Return the command that pauses the player at a time of its clip [s]."""
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


def _command(kind: str, path: str, name: str, **fields: Any) -> PageCommand:
    packed = umsgpack.packb({"type": kind, "path": path, **fields})
    return PageCommand(path, key_of(path, name), packed)


@lru_cache(maxsize=4096)
def _transform_head(path: str) -> bytes:
    """Return the bytes before the matrix; cached, as packing them costs the most."""
    head = b"".join(
        umsgpack.packb(word)
        for word in ("type", "set_transform", "path", path, "matrix")
    )
    ext8_of_16_doubles = struct.pack("BBB", 0xC7, 16 * 8, 0x18)
    return b"\x83" + head + ext8_of_16_doubles


def path_element(name: str) -> str:
    """Return a name as one element of a path in the scene tree: without slashes."""
    return name.replace("/", "_") or "_"
