"""The server's process: serves the page, and sends the scene to all open pages.

It listens on the loopback address unless it is told another one. It reads commands from
its standard input, so that no other process can send any. When the input is closed
because the parent ended or was killed, the server ends too. It imports neither
Pinocchio nor modules that do.

Pages and their connections must name the server's own host, against DNS rebinding, and
connections must come from one of its own pages. Pages and connections need a key in
their address; one page at a time may steer the program, see `Steering`.
"""

import asyncio
import hmac
import json
import os
import select
import socket
import struct
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple, NoReturn

import umsgpack  # type: ignore[import-untyped]
from tornado.httpserver import HTTPServer
from tornado.netutil import bind_sockets
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from hsp_control.visualization.viewer.pipe import (
    ASK,
    DELETE,
    Decoder,
    LatestCommands,
    PipeRecord,
    key_of,
    newest,
)

_MAX_SIZE = 1_000_000  # bytes; the commands that move a robot are far smaller


def batch_messages(commands: list[bytes]) -> list[bytes]:
    """Return packed commands as messages, each an array in MessagePack."""
    messages: list[bytes] = []
    batch: list[bytes] = []
    size = 0
    for packed in commands:
        if batch and size + len(packed) > _MAX_SIZE:
            messages.append(_array(batch))
            batch, size = [], 0
        batch.append(packed)
        size += len(packed)
    return [*messages, _array(batch)] if batch else messages


def _array(batch: list[bytes]) -> bytes:
    return struct.pack(">BI", 0xDD, len(batch)) + b"".join(batch)


LONGEST = 4000
"""Most bytes of a message of a page: a pipe that is ready takes that many at once."""


class Steering:
    """One page steers; a message replaces a waiting one of its kind and object."""

    def __init__(self, parent: int) -> None:
        """Begin without a page."""
        self.page: object | None = None
        self._parent = parent
        self._waiting: list[Mapping[str, Any]] = []

    def enter(self, page: object) -> bool:
        """Let a page that was opened steer, if no other one does; return whether."""
        if self.page is None:
            self.page = page
        return self.page is page

    def leave(self, page: object) -> bool:
        """Return whether the page that was closed has steered; the parent is told."""
        if self.page is not page:
            return False
        self.page = None
        self._put({"do": "left"})
        return True

    def receive(self, page: object, text: str) -> bool:
        """Take a page's message; return whether the page steers only from now on."""
        if len(text.encode()) > LONGEST:
            raise ValueError("the message is too long")
        message = json.loads(text, parse_constant=_refuse)
        if not isinstance(message, dict) or not isinstance(message.get("do"), str):
            raise ValueError("a message is an object with a text `do`")
        if message["do"] == "take_over":
            taken = self.page is not page
            if taken:
                self.page = page
                self._put({"do": "left"})  # what the other page held is let go
            return taken
        if self.page is page:
            self._put(message)
        return False

    def flush(self) -> bool:
        """Pass on what the parent can take now; return whether nothing waits."""
        poll = select.poll()
        poll.register(self._parent, select.POLLOUT)
        while self._waiting and poll.poll(0):
            line = json.dumps({"message": self._waiting.pop(0)})
            with open(self._parent, "w", closefd=False) as pipe:
                pipe.write(line + "\n")
        return not self._waiting

    def _put(self, message: dict[str, Any]) -> None:
        self._waiting = list(newest([*self._waiting, message]).values())


def _refuse(word: str) -> Callable[[], None]:
    raise ValueError(f"{word} is no number")


KEY = "HSP_PAGE_KEY"  # variable with the key: others can read a command line
PORTS = (*range(7000, 7100), 0)  # 0: any free port
TAKEN = "taken"  # a page's acknowledgement of a message

_TYPES = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".txt": "text/plain",
}
_LOOPBACK_NAMES = {"127.0.0.1", "localhost"}
_PARENT_CHECK_PERIOD = 1.0  # s
_FLUSH_PERIOD = 0.005  # s


class Door(NamedTuple):
    """Who is let in."""

    host: str  # the address that the server listens on
    key: str  # what an address must contain

    def check(self, handler: RequestHandler, *, needs_key: bool = True) -> None:
        """Check a request."""
        names = _LOOPBACK_NAMES if self.host in _LOOPBACK_NAMES else {self.host}
        if handler.request.host_name not in names:
            raise HTTPError(403, reason="Another host")
        given = handler.get_query_argument("key", "")
        if needs_key and not hmac.compare_digest(given.encode(), self.key.encode()):
            raise HTTPError(403, reason="The address needs the key that was printed")


class Hub:
    """The scene, and the pages that show it."""

    def __init__(self, steering: Steering | None) -> None:
        """Start with an empty scene and no page."""
        self.scene = LatestCommands()
        self.pages: set[Page] = set()
        self.asked = 0
        self.steering = steering
        self._decoder = Decoder()
        self._flushing = False

    def tell_who_steers(self) -> None:
        """Tell all pages whether they steer, and pass on what the parent is told."""
        steering = self.steering
        if steering is None:
            return
        for page in self.pages:
            page.tell_drive(steering.page is page, steering.page is not None)
        self.flush()

    def flush(self) -> None:
        """Pass on what pages have sent, soon: what comes meanwhile is put together."""
        if not self._flushing:
            self._flushing = True
            asyncio.get_running_loop().call_later(_FLUSH_PERIOD, self._flush)

    def _flush(self) -> None:
        self._flushing = False
        if self.steering is not None and not self.steering.flush():
            self.flush()

    def feed(self, data: bytes) -> None:
        """Process bytes from the parent."""
        for record in self._decoder.feed(data):
            self._take(record)
        for page in self.pages:
            page.has_pending.set()

    def _take(self, record: PipeRecord) -> None:
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

    def initialize(self, hub: Hub, door: Door) -> None:
        """Store the hub, and who is let in; called by Tornado."""
        self.hub, self._door = hub, door
        self.pending = LatestCommands()
        self.has_pending = asyncio.Event()
        self.answered = self._asked = 0
        self._ready = asyncio.Event()

    def prepare(self) -> None:
        """Check host and key, and that the connection comes from one of our pages.

        Tornado compares the origin with the host, but lets in what names no origin:
        programs, and not browsers.
        """
        self._door.check(self)
        if "Origin" not in self.request.headers:
            raise HTTPError(403, reason="The connection names no origin")

    def open(self, *args: str, **kwargs: str) -> None:
        """Send the page the stage, which must not wait for meshes, then all else."""
        self.pending = self.hub.scene.copy()
        self.has_pending.set()
        self.hub.pages.add(self)
        self._delivery = asyncio.create_task(self._deliver(self.hub.scene.stage()))
        if self.hub.steering is not None:
            self.hub.steering.enter(self)
            self.hub.tell_who_steers()

    def on_message(self, message: str | bytes) -> None:
        """Process an answer, or what a page that steers says; hang up on others."""
        steering = self.hub.steering
        try:
            if message == TAKEN:
                self._ready.set()
            elif str(message).startswith("{") and steering is not None:
                if steering.receive(self, str(message)):
                    self.hub.tell_who_steers()
                self.hub.flush()
            else:
                self.answered = max(self.answered, int(message))
        except ValueError as error:
            self.close(1008, str(error))

    def on_close(self) -> None:
        """Remove the page."""
        self.hub.pages.discard(self)
        self._delivery.cancel()
        if self.hub.steering is not None and self.hub.steering.leave(self):
            self.hub.tell_who_steers()

    def tell_drive(self, mine: bool, taken: bool) -> None:
        """Tell the page whether it steers, and whether any page does."""
        self._tell("/play", "drive", type="play_drive", mine=mine, taken=taken)

    def ask(self, number: int) -> None:
        """Request that the page returns a number once it shows all sent before."""
        if self._asked < number:
            self._asked = number
            self._tell("", "ask", type="ask", number=number)

    def _tell(self, path: str, name: str, **command: Any) -> None:
        packed = umsgpack.packb({"path": path, **command})
        self.pending.put(key_of(path, name), packed)
        self.has_pending.set()

    async def _deliver(self, stage: list[bytes]) -> None:
        """Send the stage, and from then on what is pending."""
        commands = stage
        while True:
            for message in batch_messages(commands):
                self._ready.clear()
                try:
                    await self.write_message(message, binary=True)
                except WebSocketClosedError:
                    return
                # Meanwhile newer commands replace pending ones.
                await self._ready.wait()
            await self.has_pending.wait()
            self.has_pending.clear()
            commands = self.pending.pop_all()


class FileHandler(RequestHandler):
    """Serves the page's files."""

    def initialize(self, files: dict[str, tuple[str, bytes]], door: Door) -> None:
        """Store the files, path -> (type, content), and the door; called by Tornado."""
        self._files, self._door = files, door

    def prepare(self) -> None:
        """Check the host, and for the page itself the key."""
        self._door.check(self, needs_key=self.request.path == "/")

    def get(self, name: str) -> None:
        """Send the file."""
        if name not in self._files:
            raise HTTPError(404)
        kind, content = self._files[name]
        self.set_header("Content-Type", f"{kind}; charset=utf-8")
        self.set_header("Cache-Control", "no-cache")
        self.set_header("Referrer-Policy", "no-referrer")  # the address has the key
        self.finish(content)


def main(meshcat: str, port: int, parent: int, host: str, steerable: bool) -> NoReturn:
    """Serve until the parent has ended."""
    door = Door(host, os.environ[KEY])
    asyncio.run(_serve(Path(meshcat), port, parent, door, steerable))
    os._exit(0)


async def _serve(
    meshcat: Path, port: int, parent: int, door: Door, steerable: bool
) -> None:
    files = {
        file.name: (_TYPES[file.suffix], file.read_bytes())
        for file in (
            *(Path(__file__).parent / "page").iterdir(),
            meshcat / "main.min.js",
        )
    }
    files[""] = files.pop("index.html")
    hub = Hub(Steering(sys.stdout.fileno()) if steerable else None)
    routes: list[Any] = [
        (r"/scene", Page, {"hub": hub, "door": door}),
        (r"/(.*)", FileHandler, {"files": files, "door": door}),
    ]
    sockets = _listen(door.host, port)
    application = Application(
        routes, websocket_ping_interval=20, websocket_max_message_size=LONGEST
    )
    HTTPServer(application).add_sockets(sockets)
    os.set_blocking(0, False)
    asyncio.get_running_loop().add_reader(0, _read, hub)
    address = f"http://{door.host}:{sockets[0].getsockname()[1]}/"
    _tell_parent(url=f"{address}?key={door.key}")
    # Other children of the parent may hold our standard input open after its death.
    while os.getppid() == parent:
        await asyncio.sleep(_PARENT_CHECK_PERIOD)


def _listen(host: str, port: int) -> list[socket.socket]:
    candidates = (port,) if port else PORTS
    for candidate in candidates:
        try:
            return bind_sockets(candidate, address=host, family=socket.AF_INET)
        except OSError as error:
            reason = error.strerror
    raise OSError(f"cannot listen on {host}:{candidates[-1]}: {reason}")


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
