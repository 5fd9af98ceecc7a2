"""Pictures of a simulated robot's MuJoCo scene by HTTP: ``/CAMERA.jpg``.

A separate process draws pictures on request, in the scene's state at that time; the
simulation only copies its state. Without a graphics card Mesa draws.
"""

import ctypes
import multiprocessing
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from http.server import BaseHTTPRequestHandler, HTTPServer
from io import BytesIO
from multiprocessing.connection import Connection
from multiprocessing.util import Finalize
from socket import SHUT_RDWR
from threading import Thread, Timer
from time import monotonic
from typing import Any
from urllib.parse import parse_qsl, unquote, urlsplit

import numpy as np
from PIL import Image

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.common.host_names import check_host_name
from hsp_control.common.silence import Silence
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.mujoco.plant import MujocoEngine
from hsp_control.simulation.plants import ImperfectPlant, Plant

_FORMATS: dict[str, dict[str, Any]] = {
    "jpg": {"format": "JPEG", "quality": 95},
    "png": {"format": "PNG"},
}
_SIZE = {"width": 640, "height": 480}
_LARGEST = 2048
"""Maximum width and height [pixels]."""
_SIZES = 4
"""Number of picture sizes whose renderers are kept."""
_REQUEST = 2.0
"""Maximum duration in which a request arrives [s]."""
_PATIENCE = 60.0
"""Maximum time until the first picture can be drawn [s]."""
_HANGS = 20.0
"""Silence after which the drawing process is treated as hanging [s]: without a graphics
card the first large picture of a size takes some seconds."""
_INSTALL = "(pip install 'hsp_control[cameras]'; on Debian and Ubuntu also libegl1)"


def show(address: str, plant: Plant) -> Callable[..., object]:
    """Serve pictures of a plant; return a function to call after each of its steps.

    Args:
        address: ``HOST:PORT``.
        plant: The plant, which MuJoCo moves.

    Raises:
        HardwareError: If the address is invalid, the scene has no camera, or nothing
        can be drawn here; by the returned function, if the drawing process has ended or
        hangs.
    """
    where = f"http://{address}"
    try:
        parts = urlsplit(where)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not host or not port or where != f"http://{host}:{port}":
        raise HardwareError(
            f"{where}: needs http://HOST:PORT, for example http://127.0.0.1:5008"
        )
    while isinstance(plant, ImperfectPlant):
        plant = plant.plant
    if not isinstance(plant, MujocoEngine) or not plant.model.ncam:
        raise HardwareError(
            f"{where}: there is no camera; needs plant: mujoco_scene, and a <camera> "
            "in its MJCF"
        )
    import mujoco

    model, data = plant.model, plant.data
    compiled = np.zeros(mujoco.mj_sizeModel(model), np.uint8)
    mujoco.mj_saveModel(model, None, compiled)
    kind = int(mujoco.mjtState.mjSTATE_INTEGRATION)
    anew = multiprocessing.get_context("spawn")
    memory = anew.RawArray(ctypes.c_double, mujoco.mj_stateSize(model, kind))
    state, lock = np.ctypeslib.as_array(memory), anew.Lock()

    ours, theirs = anew.Pipe(duplex=False)
    alive = anew.RawValue(ctypes.c_ulonglong)  # incremented by the process that draws
    arguments = (host, port, compiled.tobytes(), memory, lock, theirs, alive)
    drawing = anew.Process(target=_serve, args=arguments, name="cameras", daemon=True)
    silence, counted = Silence(monotonic()), 0

    def tell(*_: object) -> None:
        nonlocal counted
        if drawing.exitcode is not None:
            raise HardwareError(
                f"{where}: the process that draws its pictures has ended"
            )
        before, counted = counted, alive.value
        if silence.look(monotonic(), received=counted != before) > _HANGS:
            raise HardwareError(
                f"{where}: the process that draws its pictures has not responded for "
                f"{_HANGS:g} s"
            )
        if lock.acquire(block=False):  # the drawing process holds it for microseconds
            try:
                mujoco.mj_getState(model, data, state, kind)
            finally:
                lock.release()

    tell()
    drawing.start()
    # Python would end it with SIGTERM, which a hanging process does not receive.
    Finalize(drawing, drawing.kill, exitpriority=10)
    theirs.close()
    try:
        ready = ours.poll(_PATIENCE)
        fault = ours.recv() if ready else f"it did not start in {_PATIENCE:g} s"
    except EOFError:
        fault = "its process has ended"
    except BaseException:  # such as Ctrl-C
        drawing.kill()
        raise
    if fault:
        drawing.kill()
        raise HardwareError(f"{where}: no pictures can be drawn: {fault}")
    return tell


def _serve(
    host: str,
    port: int,
    compiled: bytes,
    memory: Any,
    lock: Any,
    ready: Connection,
    alive: Any,
) -> None:
    """Draw until the simulating process has ended."""
    nothing = os.open(os.devnull, os.O_RDWR)
    for pipe in (0, 1):  # those of its parent, which waits for their end
        os.dup2(nothing, pipe)
    os.nice(10)
    Thread(target=_end_with_parent, daemon=True).start()
    try:
        pictures = _Pictures(compiled, memory, lock)
        check_host_name(host)
        server = _Drawer((host, port), _Handler)
        server.pictures, server.alive = pictures, alive
    except ImportError as error:
        ready.send(f"{error} {_INSTALL}")
        return
    except (RuntimeError, OSError, AttributeError) as error:
        ready.send(str(error) or type(error).__name__)
        return
    ready.send("")
    server.serve_forever()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(0)


class _Pictures:
    """Draws a scene whose state another process writes."""

    def __init__(self, compiled: bytes, memory: Any, lock: Any) -> None:
        """Load the scene, and try whether it can be drawn."""
        os.environ.setdefault("MUJOCO_GL", "egl")  # no screen is needed
        import mujoco

        self._mujoco, name = mujoco, "scene.mjb"
        self.model = mujoco.MjModel.from_binary_path(name, {name: compiled})
        self.model.vis.global_.offwidth = self.model.vis.global_.offheight = _LARGEST
        self._data = mujoco.MjData(self.model)
        self._state, self._lock = np.ctypeslib.as_array(memory), lock
        self._renderers: dict[tuple[int, int], Any] = {}
        self.cameras = [self.model.camera(k).name for k in range(self.model.ncam)]
        self.drawn(0, **_SIZE)

    def drawn(self, camera: int, width: int, height: int) -> tuple[float, Array]:
        """Return the time [s], and a camera's picture, shape (height, width, 3)."""
        mujoco, data = self._mujoco, self._data
        if (width, height) not in self._renderers:
            if len(self._renderers) == _SIZES:
                self._renderers.pop(next(iter(self._renderers))).close()
            renderer = mujoco.Renderer(self.model, height, width)
            self._renderers[width, height] = renderer
        with self._lock:
            state = self._state.copy()
        kind = int(mujoco.mjtState.mjSTATE_INTEGRATION)
        mujoco.mj_setState(self.model, data, state, kind)
        mujoco.mj_forward(self.model, data)
        renderer = self._renderers[width, height]
        renderer.update_scene(data, camera)
        return float(data.time), renderer.render()


class _Drawer(HTTPServer):
    """Answers one request after another, in the thread that draws."""

    pictures: _Pictures
    alive: Any  # incremented while it is alive, also while it waits

    def service_actions(self) -> None:
        """Report that it is alive: twice a second, and after each request."""
        self.alive.value += 1

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Ignore a client that has gone before it had its picture."""
        if not isinstance(sys.exc_info()[1], OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """Answers one request."""

    server: _Drawer
    timeout = 1.0  # of a client that sends or reads nothing [s]

    def setup(self) -> None:
        """Begin with a request, which must arrive in time, however its parts do."""
        super().setup()
        self._late = Timer(_REQUEST, self._hang_up)
        self._late.daemon = True
        self._late.start()

    def finish(self) -> None:
        """End the connection."""
        self._late.cancel()
        super().finish()

    def _hang_up(self) -> None:
        with suppress(OSError):
            self.connection.shutdown(SHUT_RDWR)

    def do_GET(self) -> None:
        """Send a picture, or list the cameras."""
        self._late.cancel()
        try:
            camera, ending, size = _asked(self.path, self.server.pictures.cameras)
        except ValueError as error:
            self.send_error(404, explain=str(error))
            return
        t, picture = self.server.pictures.drawn(camera, **size)
        text = BytesIO()
        Image.fromarray(picture).save(text, **_FORMATS[ending])
        self.send_response(200)
        self.send_header("Content-Type", f"image/{_FORMATS[ending]['format']}".lower())
        self.send_header("Content-Length", str(text.tell()))
        self.send_header("Time", repr(t))
        self.end_headers()
        self.wfile.write(text.getvalue())

    def log_message(self, *_: Any) -> None:
        """Log nothing."""


def _asked(path: str, cameras: list[str]) -> tuple[int, str, dict[str, int]]:
    """Return the camera, the format and the size in the path of a request."""
    parts = urlsplit(path)
    name, _, ending = unquote(parts.path).removeprefix("/").rpartition(".")
    if name not in cameras or ending not in _FORMATS:
        there = listing([f"/{each}.jpg" for each in cameras])
        raise ValueError(f"no {path}{did_you_mean(name, cameras)} (there is {there})")
    size = dict(_SIZE)
    for key, value in parse_qsl(parts.query):
        if key not in size or not value.isdecimal() or not 0 < int(value) <= _LARGEST:
            raise ValueError(
                f"{key}={value}; needs width and height, each 1 to {_LARGEST}"
            )
        size[key] = int(value)
    return cameras.index(name), ending, size
