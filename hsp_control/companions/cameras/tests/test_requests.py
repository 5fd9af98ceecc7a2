"""Requests for pictures whose parts come late, or whose sender goes away."""

import socket
import struct
import threading
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing import Value
from time import monotonic, sleep
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("mujoco")

import mujoco

from hsp_control.companions.cameras import pictures


@pytest.fixture
def server() -> Iterator[pictures._Drawer]:
    """A server of black pictures."""
    made = pictures._Drawer(("127.0.0.1", 0), pictures._Handler)
    black = np.zeros((480, 640, 3), dtype=np.uint8)
    drawn = SimpleNamespace(cameras=["above"], drawn=lambda *_, **__: (0.0, black))
    made.pictures = drawn  # type: ignore[assignment]
    made.alive = Value("Q", 0)
    thread = threading.Thread(target=made.serve_forever)
    thread.start()
    yield made
    made.shutdown()
    thread.join()
    made.server_close()


def test_a_request_arrives_in_two_seconds_or_not(
    server: pictures._Drawer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A byte every 0.2 s: no byte is late, but the robot would wait for all of them."""
    monkeypatch.setattr(pictures, "_REQUEST", 0.5)
    with socket.create_connection(server.server_address[:2]) as client:
        begin = monotonic()
        with suppress(OSError):  # reset, or a broken pipe
            for byte in b"GET /above.jpg HTTP/1.1\r\n" * 100:
                client.send(bytes([byte]))
                sleep(0.2)
            pytest.fail("the server waits for all bytes")
    alive = server.alive.value
    while server.alive.value == alive:
        assert monotonic() < begin + 60.0
        sleep(0.01)


def test_a_client_that_goes_away_is_forgotten(
    server: pictures._Drawer, capfd: pytest.CaptureFixture[str]
) -> None:
    for _ in range(3):
        client = socket.create_connection(server.server_address[:2])
        linger = struct.pack("ii", 1, 0)  # close with a reset
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
        client.sendall(b"GET /above.png HTTP/1.0\r\n\r\n")
        client.close()
    with socket.create_connection(server.server_address[:2]) as client:
        client.sendall(b"GET /above.jpg HTTP/1.0\r\n\r\n")
        assert client.recv(100).startswith(b"HTTP/1.0 200")
    assert "Traceback" not in capfd.readouterr().err


def test_renderers_of_sizes_that_are_not_used_are_closed() -> None:
    closed = list[int]()

    class Renderer:
        def __init__(self, model: object, height: int, width: int) -> None:
            self.width = width

        def update_scene(self, *_: object) -> None:
            pass

        def render(self) -> np.ndarray:
            return np.zeros((1, self.width, 3))

        def close(self) -> None:
            closed.append(self.width)

    drawing = object.__new__(pictures._Pictures)
    nothing = dict.fromkeys(("mj_setState", "mj_forward"), lambda *_: None)
    drawing._mujoco = SimpleNamespace(
        Renderer=Renderer, mjtState=mujoco.mjtState, **nothing
    )
    drawing.model, drawing._data = None, SimpleNamespace(time=0.0)
    drawing._state, drawing._lock = np.zeros(1), threading.Lock()
    drawing._renderers = {}
    for width in range(1, 7):
        drawing.drawn(0, width, 1)
    assert closed == [1, 2]


def test_no_timer_outlives_its_request(
    server: pictures._Drawer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nor that of a client that sends nothing."""
    monkeypatch.setattr(pictures, "_REQUEST", 600.0)
    socket.create_connection(server.server_address[:2]).close()
    with socket.create_connection(server.server_address[:2]) as client:
        client.sendall(b"GET /above.jpg HTTP/1.0\r\n\r\n")
        assert client.recv(100).startswith(b"HTTP/1.0 200")
    for timer in threading.enumerate():
        if isinstance(timer, threading.Timer) and "_hang_up" in repr(timer.function):
            timer.join(10.0)  # one that is cancelled ends at once
            assert not timer.is_alive()


@pytest.mark.parametrize("width", ["0", "2049", "-1", "1.5"])
def test_a_picture_that_cannot_be_drawn_is_refused(width: str) -> None:
    with pytest.raises(ValueError, match=f"^width={width}; needs width and height"):
        pictures._asked(f"/left/above.jpg?width={width}", ["left/above"])


def test_a_request_names_camera_format_and_size() -> None:
    cameras = ["left/above", "a.b"]
    whole = {"width": 640, "height": 480}
    for path, found in (
        (
            "/left/above.png?width=1&height=2048",
            (0, "png", {"width": 1, "height": 2048}),
        ),
        ("/left%2Fabove.jpg?height=90", (0, "jpg", whole | {"height": 90})),
        ("/a.b.jpg", (1, "jpg", whole)),
    ):
        assert pictures._asked(path, cameras) == found
