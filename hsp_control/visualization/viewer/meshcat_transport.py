"""Draws into an ordinary Meshcat server that is already open, beside other things.

Such a page knows Meshcat's own commands, and not those that ours adds: paths become
lines, a clip becomes an animation of the page's own player, and what is shown live
moves with each message. Background, light, floor, camera and captions stay the other
program's, and so do all nodes outside our own.
"""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
import umsgpack  # type: ignore[import-untyped]

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ViewerError
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.commands import Command, Json, unpack

TIMEOUT = 5.0
"""Time in which the server must answer [s]."""
DEFAULT_ROOT = "/hsp_control"
"""The node of our scene, where only an address was given."""
_OURS_ALONE = ("/Background", "/lights", "/floor", "/plots")
_NATIVE = {"set_object", "set_transform", "set_property", "delete"}
_ANIMATED = {
    "position": "vector3",
    "scale": "vector3",
    "quaternion": "quaternion",
    "visible": "boolean",
}
"""The properties that Meshcat's player animates, and three.js's names of their kind."""


class MeshcatTransport:
    """Sends the scene to a Meshcat server; see `Transport`.

    Attributes:
        url: The page's address, as the server says it.
        scene: None: others may have drawn more than is known here.
    """

    scene = None

    def __init__(self, meshcat: Any) -> None:
        """Connect.

        Args:
            meshcat: A `meshcat.Visualizer`, under whose path the scene is put, or the
                address of its server, as ``tcp://127.0.0.1:6000``.

        Raises:
            ViewerError: If it is neither, or no server answers.
        """
        import zmq

        if isinstance(meshcat, str):
            address, self._root = meshcat, DEFAULT_ROOT
        elif hasattr(meshcat, "window") and hasattr(meshcat, "path"):
            address = meshcat.window.zmq_url
            self._root = meshcat.path.lower()
        else:
            raise ViewerError(
                "meshcat is a meshcat.Visualizer or the address of its server; got "
                f"{type(meshcat).__name__}"
            )
        # A connection of our own: the visualizer's waits for ever, and may be waiting.
        self._address = address
        self._socket: Any = zmq.Context.instance().socket(zmq.REQ)
        for option in (zmq.RCVTIMEO, zmq.SNDTIMEO):
            self._socket.setsockopt(option, int(1e3 * TIMEOUT))
        self._socket.setsockopt(zmq.LINGER, 0)
        try:
            self._socket.connect(address)
            self.url: str | None = self._ask(b"url").decode()
        except zmq.ZMQError as error:
            raise ViewerError(f"{address!r} is no address: {error}") from None

    def send(self, commands: Iterable[Command]) -> None:
        """Send commands.

        Raises:
            ViewerError: If the server does not answer.
        """
        for command in commands:
            for each in _understood(command, self._root):
                kind, path = each["type"].encode(), each["path"].encode()
                self._ask(kind, path, umsgpack.packb(each))

    def wait_for_page(self, timeout: float) -> bool:
        """Return False: the server tells nobody whether a page is open."""
        return False

    def wait_until_closed(self) -> None:
        """Return at once: the page is another program's."""

    def close(self) -> None:
        """Disconnect; the scene stays. A second call does nothing."""
        self._socket.close()

    def _ask(self, *parts: bytes) -> bytes:
        import zmq

        if self._socket.closed:
            raise ViewerError("the viewer is closed")
        try:
            self._socket.send_multipart(parts)
            return bytes(self._socket.recv())
        except zmq.Again:
            self.close()
            raise ViewerError(
                f"no Meshcat server answers at {self._address} within {TIMEOUT:g} s"
            ) from None


def _understood(command: Command, root: str) -> Iterator[Json]:
    """Yield Meshcat's commands for one of ours; none for what it cannot show."""
    if command.path.startswith(_OURS_ALONE):
        return
    path = root + command.path
    raw: Json = umsgpack.unpackb(command.packed)
    kind = raw["type"]
    if kind in _NATIVE:
        yield raw | {"path": path}
    elif kind == "trail":
        data = unpack(command.packed)
        line = _line(np.reshape(data["points"], (-1, 3)), data["color"])
        yield {"type": "set_object", "path": path, "object": line}
    elif kind == "pose":
        yield from _last_poses(unpack(command.packed)["tracks"], root)
    elif kind == "clip":
        data = unpack(command.packed)
        if data["open"] or not data["begins"]:  # it is being computed: show its end
            yield from _last_poses(data["tracks"], root)
        else:
            yield _animation(data, root)


def _line(points: Array, color: int) -> Json:
    """Return a line through points [m], shape (N, 3), one pixel wide."""
    rgb = [(color >> shift & 255) / 255.0 for shift in (16, 8, 0)]
    pairs = np.repeat(points, 2, axis=0)[1:-1]
    return threejs.group(
        [threejs.segments(pairs, np.tile([*rgb, 1.0], (len(pairs), 1)))]
    )


def _last_poses(tracks: list[Json], root: str) -> Iterator[Json]:
    """Yield what shows the last row of tracks."""
    for track in tracks:
        name = track["property"]
        if name in _ANIMATED:
            yield {
                "type": "set_property",
                "path": root + track["path"],
                "property": name,
                "value": _values(track)[-1],
            }


def _animation(clip: Json, root: str) -> Json:
    """Return Meshcat's animation of a whole clip; its time begins at zero."""
    tracks: dict[str, list[Json]] = {}
    for track in clip["tracks"]:
        name = track["property"]
        if name not in _ANIMATED:
            continue
        times = np.asarray(clip["clocks"][track["clock"]]) - clip["start"]
        keys = [
            {"time": time, "value": value}
            for time, value in zip(times.tolist(), _values(track), strict=True)
        ]
        kind = {"name": f".{name}", "type": _ANIMATED[name], "keys": keys}
        tracks.setdefault(root + track["path"], []).append(kind)
    return {
        "type": "set_animation",
        "path": "",
        "animations": [
            {"path": path, "clip": {"fps": 1, "name": "default", "tracks": own}}
            for path, own in tracks.items()
        ],
        "options": {"play": clip["play"], "repetitions": 1000 if clip["loop"] else 1},
    }


def _values(track: Json) -> list[Any]:
    """Return a track's values, one for each time."""
    if track["property"] == "visible":
        return [bool(value > 0.5) for value in track["values"]]
    width = 4 if track["property"] == "quaternion" else 3
    values: list[Any] = np.reshape(track["values"], (-1, width)).tolist()
    return values
