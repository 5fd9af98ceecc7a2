"""The server's process: serves the page and passes the scene on to all who look.

It listens on the loopback address alone. Commands come in through its standard input,
so that no other process can send any; when that ends, for whatever reason its parent
died, so does the server. It imports neither Pinocchio nor anything that does.
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

from hsp_control.visualization.viewer.batches import batches
from hsp_control.visualization.viewer.kept import Kept, key_of
from hsp_control.visualization.viewer.records import ASK, DELETE, Decoder, Record

ADDRESS = "127.0.0.1"
PORTS = (*range(7000, 7100), 0)  # 0: any that is free
TAKEN = "taken"  # what a page answers to each message

_TYPES = {".html": "text/html", ".js": "text/javascript", ".css": "text/css"}
_LOOPBACK_NAMES = {"127.0.0.1", "localhost"}
_CHILD_WATCH = 1.0  # s


class Hub:
    """The scene, and the pages that show it.

    Attributes:
        scene: All that a page which opens now has to be told.
        pages: Those that are open.
        asked: How often it was asked whether a page shows everything.
    """

    def __init__(self) -> None:
        """Start with an empty scene and no page."""
        self.scene = Kept()
        self.pages: set[Page] = set()
        self.asked = 0
        self._decoder = Decoder()

    def feed(self, data: bytes) -> None:
        """Take bytes from the parent."""
        for record in self._decoder.feed(data):
            self._take(record)
        for page in self.pages:
            page.news.set()

    def _take(self, record: Record) -> None:
        kind, name, packed = record
        if kind == ASK:
            self._answer(int(name))
        elif kind == DELETE:
            self.scene.drop(name)
            for page in self.pages:
                page.mail.drop(name)
                page.mail.put(key_of(name, "delete"), packed)
        else:
            self.scene.put(name, packed)
            for page in self.pages:
                page.mail.put(name, packed)

    def _answer(self, number: int) -> None:
        """Tell the parent how many pages show all that came before its question."""
        self.asked = number
        for page in self.pages:
            page.ask(number)
        up_to_date = sum(page.answered >= number for page in self.pages)
        _tell_parent(number=number, pages=len(self.pages), up_to_date=up_to_date)


class Page(WebSocketHandler):
    """One open page. What it has not been told yet is replaced by what is newer."""

    def initialize(self, hub: Hub) -> None:
        """Join the hub; called by Tornado."""
        self.hub = hub
        self.mail = Kept()
        self.news = asyncio.Event()
        self.answered = self._asked = 0
        self._ready = asyncio.Event()

    def open(self, *args: str, **kwargs: str) -> None:
        """Send the page the whole scene, and from then on what changes."""
        self.mail = self.hub.scene.copy()
        self.news.set()
        self.hub.pages.add(self)
        self._delivery = asyncio.create_task(self._deliver())

    def on_message(self, message: str | bytes) -> None:
        """Note that the page has taken a message, or up to where it shows all."""
        if message == TAKEN:
            self._ready.set()
        else:
            self.answered = max(self.answered, int(message))

    def on_close(self) -> None:
        """Forget the page."""
        self.hub.pages.discard(self)
        self._delivery.cancel()

    def ask(self, number: int) -> None:
        """Have the page answer a number once it shows what was sent before."""
        if self._asked < number:
            self._asked = number
            # {"type": "ask", "number": ...}, the number as an unsigned 32-bit integer
            packed = b"\x82\xa4type\xa3ask\xa6number\xce" + struct.pack(">I", number)
            self.mail.put(key_of("", "ask"), packed)
            self.news.set()

    async def _deliver(self) -> None:
        while True:
            await self.news.wait()
            self.news.clear()
            for message in batches(self.mail.take()):
                self._ready.clear()
                try:
                    await self.write_message(message, binary=True)
                except WebSocketClosedError:
                    return
                await self._ready.wait()  # meanwhile, what is newer replaces the mail


class File(RequestHandler):
    """One of the page's files."""

    def initialize(self, files: dict[str, tuple[str, bytes]]) -> None:
        """Take the files by path, each as its type and content; called by Tornado."""
        self._files = files

    def prepare(self) -> None:
        """Refuse a page of another site whose name was made to lead here."""
        if self.request.host_name not in _LOOPBACK_NAMES:
            raise HTTPError(403)

    def get(self, name: str) -> None:
        """Answer with the file."""
        if name not in self._files:
            raise HTTPError(404)
        kind, content = self._files[name]
        self.set_header("Content-Type", f"{kind}; charset=utf-8")
        self.set_header("Cache-Control", "no-cache")
        self.finish(content)


def main(meshcat: str, port: int, parent: int) -> NoReturn:
    """Serve until the parent is gone.

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
        (r"/(.*)", File, {"files": files}),
    ]
    sockets = _listen(port)
    HTTPServer(Application(routes, websocket_ping_interval=20)).add_sockets(sockets)
    os.set_blocking(0, False)
    asyncio.get_running_loop().add_reader(0, _read, hub)
    _tell_parent(url=f"http://{ADDRESS}:{sockets[0].getsockname()[1]}/")
    # Other children of the parent may hold our standard input open after its death.
    while os.getppid() == parent:
        await asyncio.sleep(_CHILD_WATCH)


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
    if not data:  # the parent is gone
        os._exit(0)
    hub.feed(data)


def _tell_parent(**facts: Any) -> None:
    sys.stdout.write(json.dumps(facts) + "\n")
    sys.stdout.flush()
