"""The server's process: serves the page, and sends the scene to all open pages.

It listens on the loopback address only. It reads commands from its standard input, so
that no other process can send any. When the input is closed because the parent ended
or was killed, the server ends too. It imports neither Pinocchio nor modules that do.
"""

import asyncio
import json
import os
import socket
import struct
import sys
from pathlib import Path
from typing import Any, NoReturn

from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from hsp_control.visualization.viewer.latest_commands import LatestCommands, key_of
from hsp_control.visualization.viewer.message_batches import batch_messages
from hsp_control.visualization.viewer.pipe_protocol import ASK, DELETE, Decoder, Record

ADDRESS = "127.0.0.1"
PORTS = (*range(7000, 7100), 0)  # 0: any free port
TAKEN = "taken"  # a page's acknowledgement of a message

_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}
_LOOPBACK_NAMES = {"127.0.0.1", "localhost"}
_PARENT_CHECK_PERIOD = 1.0  # s


class Hub:
    """The scene, and the pages that show it.

    Attributes:
        scene: All commands that a newly opened page needs.
        pages: The open pages.
        asked: The number of the parent's latest request: does a page show everything?
    """

    def __init__(self) -> None:
        """Start with an empty scene and no page."""
        self.scene = LatestCommands()
        self.pages: set[Page] = set()
        self.asked = 0
        self._decoder = Decoder()

    def feed(self, data: bytes) -> None:
        """Process bytes from the parent."""
        for record in self._decoder.feed(data):
            self._take(record)
        for page in self.pages:
            page.has_pending.set()

    def _take(self, record: Record) -> None:
        kind, name, packed = record
        if kind == ASK:
            self._answer(int(name))
        elif kind == DELETE:
            self.scene.drop(name)
            for page in self.pages:
                page.pending.drop(name)
                page.pending.put(key_of(name, "delete"), packed)
        else:
            self.scene.put(name, packed)
            for page in self.pages:
                page.pending.put(name, packed)

    def _answer(self, number: int) -> None:
        """Report to the parent how many pages show all that was sent before."""
        self.asked = number
        for page in self.pages:
            page.ask(number)
        up_to_date = sum(page.answered >= number for page in self.pages)
        _tell_parent(number=number, pages=len(self.pages), up_to_date=up_to_date)


class Page(WebSocketHandler):
    """One open page. A newer command replaces one of its key that was not yet sent."""

    def initialize(self, hub: Hub) -> None:
        """Store the hub; called by Tornado."""
        self.hub = hub
        self.pending = LatestCommands()
        self.has_pending = asyncio.Event()
        self.answered = self._asked = 0
        self._ready = asyncio.Event()

    def open(self, *args: str, **kwargs: str) -> None:
        """Send the page the whole scene, then all changes."""
        self.pending = self.hub.scene.copy()
        self.has_pending.set()
        self.hub.pages.add(self)
        self._delivery = asyncio.create_task(self._deliver())

    def on_message(self, message: str | bytes) -> None:
        """Process an answer: an acknowledgement, or the number of a request."""
        if message == TAKEN:
            self._ready.set()
        else:
            self.answered = max(self.answered, int(message))

    def on_close(self) -> None:
        """Remove the page."""
        self.hub.pages.discard(self)
        self._delivery.cancel()

    def ask(self, number: int) -> None:
        """Request that the page returns a number once it shows all sent before."""
        if self._asked < number:
            self._asked = number
            # {"type": "ask", "number": ...}, the number as an unsigned 32-bit integer
            packed = b"\x82\xa4type\xa3ask\xa6number\xce" + struct.pack(">I", number)
            self.pending.put(key_of("", "ask"), packed)
            self.has_pending.set()

    async def _deliver(self) -> None:
        while True:
            await self.has_pending.wait()
            self.has_pending.clear()
            for message in batch_messages(self.pending.take()):
                self._ready.clear()
                try:
                    await self.write_message(message, binary=True)
                except WebSocketClosedError:
                    return
                await (
                    self._ready.wait()
                )  # meanwhile newer commands replace pending ones


class FileHandler(RequestHandler):
    """Serves the page's files."""

    def initialize(self, files: dict[str, tuple[str, bytes]]) -> None:
        """Store the files, path -> (type, content); called by Tornado."""
        self._files = files

    def prepare(self) -> None:
        """Check that the request names the loopback host, against DNS rebinding."""
        if self.request.host_name not in _LOOPBACK_NAMES:
            raise HTTPError(403)

    def get(self, name: str) -> None:
        """Send the file."""
        if name not in self._files:
            raise HTTPError(404)
        kind, content = self._files[name]
        self.set_header("Content-Type", f"{kind}; charset=utf-8")
        self.set_header("Cache-Control", "no-cache")
        self.finish(content)


def main(meshcat: str, port: int, parent: int) -> NoReturn:
    """Serve until the parent has ended.

    Args:
        meshcat: The folder of Meshcat's page.
        port: The port to listen on, or 0 for a free one.
        parent: The parent's process id.
    """
    asyncio.run(_serve(Path(meshcat), port, parent))
    os._exit(0)


async def _serve(meshcat: Path, port: int, parent: int) -> None:
    files = {
        file.name: (_TYPES[file.suffix], file.read_bytes())
        for file in (
            *(Path(__file__).parent / "page").iterdir(),
            meshcat / "main.min.js",
        )
    }
    files[""] = files.pop("index.html")
    hub = Hub()
    routes: list[Any] = [
        (r"/scene", Page, {"hub": hub}),
        (r"/(.*)", FileHandler, {"files": files}),
    ]
    sockets = _listen(port)
    HTTPServer(Application(routes, websocket_ping_interval=20)).add_sockets(sockets)
    os.set_blocking(0, False)
    asyncio.get_running_loop().add_reader(0, _read, hub)
    _tell_parent(url=f"http://{ADDRESS}:{sockets[0].getsockname()[1]}/")
    # Other children of the parent may hold our standard input open after its death.
    while os.getppid() == parent:
        await asyncio.sleep(_PARENT_CHECK_PERIOD)


def _listen(port: int) -> list[socket.socket]:
    candidates = (port,) if port else PORTS
    for candidate in candidates:
        try:
            return bind_sockets(candidate, address=ADDRESS, family=socket.AF_INET)
        except OSError as error:
            reason = error.strerror
    raise OSError(f"cannot listen on {ADDRESS}:{candidates[-1]}: {reason}")


def _read(hub: Hub) -> None:
    try:
        data = os.read(0, 1 << 20)
    except BlockingIOError:
        return
    if not data:  # the parent has ended
        os._exit(0)
    hub.feed(data)


def _tell_parent(**facts: Any) -> None:
    sys.stdout.write(json.dumps(facts) + "\n")
    sys.stdout.flush()
