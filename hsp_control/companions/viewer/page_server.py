"""The server of a page: it sends the scene to all open pages, from a separate thread.

Pages and their connections must name the server's own host, against DNS rebinding, and
connections must come from one of its own pages. Pages and connections need a key in
their address; one page at a time may steer the program.
"""

import asyncio
import gzip
import hmac
import json
import os
import socket
import struct
from collections.abc import Callable, Iterable
from contextlib import suppress
from functools import partial
from pathlib import Path
from threading import Lock, Thread
from typing import Any, NamedTuple, NoReturn

from tornado.httpserver import HTTPServer
from tornado.web import Application, HTTPError, RequestHandler
from tornado.websocket import WebSocketClosedError, WebSocketHandler

from hsp_control.common.host_names import check_host_name
from hsp_control.companions.viewer.commands import (
    PLAY,
    LatestCommands,
    PageCommand,
    key_of,
    pack,
)

_LARGE = 100_000  # bytes of a message from which on it is compressed: meshes
_MAX_SIZE = 1_000_000  # bytes; the commands that move a robot are far smaller
_LONGEST = 4000  # maximum size of a page's message [bytes]
_LONGEST_REASON = 120  # of a disconnection [bytes]


def batch_messages(commands: list[bytes]) -> list[bytes]:
    """Return packed commands as messages, which are arrays in MessagePack."""
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


def _refuse(word: str) -> NoReturn:
    raise ValueError(f"{word} is no number")


PORTS = (*range(7000, 7100), 0)  # 0: any free port
TAKEN = "taken"  # a page's acknowledgement of a message

_TYPES = {
    ".html": "text/html",
    ".js": "text/javascript",
    ".css": "text/css",
    ".txt": "text/plain",
}
_LOOPBACK_NAMES = {"127.0.0.1", "localhost"}


class Door(NamedTuple):
    """The conditions of access."""

    host: str  # the address that the server listens on
    key: str  # the key that an address must contain

    def check(self, handler: RequestHandler, *, needs_key: bool = True) -> None:
        """Check a request."""
        names = _LOOPBACK_NAMES if self.host in _LOOPBACK_NAMES else {self.host}
        if handler.request.host_name not in names:
            raise HTTPError(403, reason="Another host")
        given = handler.get_query_argument("key", "")
        if needs_key and not hmac.compare_digest(given.encode(), self.key.encode()):
            raise HTTPError(403, reason="The address needs the key that was printed")


class Hub:
    """The scene, and the pages that show it: the state shared by program and thread."""

    def __init__(self, scene: LatestCommands, *, steerable: bool) -> None:
        """Begin without a page."""
        self.scene, self.steerable = scene, steerable
        self.lock = (
            Lock()
        )  # protects all attributes, and the commands that are pending for pages
        self.pages: set[Page] = set()
        self.steering: Page | None = None  # the page that steers
        self.received: dict[
            str, dict[str, Any]
        ] = {}  # its newest messages, by `receive`
        self.asked = 0
        self.end = asyncio.Event()  # of the server
        self.failure: BaseException | None = None  # error that ended it

    def keep(self, commands: Iterable[PageCommand]) -> None:
        """Add commands to the scene, and to the next messages to pages."""
        commands = list(commands)
        with self.lock:
            self.scene.keep(commands)
            for page in self.pages:
                page.pending.keep(commands, deletions=True)

    def receive(self, message: dict[str, Any]) -> None:
        """Keep a page's message: the newest of each kind and object, latest last."""
        about = [message.get(name, "") for name in ("do", "target", "name", "id")]
        key = json.dumps(about)
        with self.lock:
            self.received.pop(key, None)
            self.received[key] = message

    def steer(self, page: "Page | None") -> None:
        """Let a page steer from now on; whatever the previous page held is released."""
        if self.steering is not None:
            self.receive({"do": "left"})
        self.steering = page
        self.show_who_steers()

    def show_who_steers(self) -> None:
        """Report to all pages whether they steer, and whether any does."""
        taken = self.steering is not None
        for page in self.pages:
            mine = self.steering is page
            page.command(PLAY, "drive", type="play_drive", mine=mine, taken=taken)

    def fail(self, error: BaseException) -> None:
        """End the server: an object of a page could not be released."""
        self.failure = self.failure or error
        self.end.set()

    def leave(self) -> "set[Page]":
        """Return the pages that were open, and forget them."""
        with self.lock:
            pages, self.pages = self.pages, set()
        return pages

    def notify(self) -> None:
        """Let pages send their pending commands."""
        for page in self.pages:
            page.has_pending.set()

    def ask(self) -> None:
        """Request that pages return a number once they show everything sent."""
        for page in self.pages:
            page.ask()

    def up_to_date(self, number: int) -> bool:
        """Return whether a page shows everything sent before this number."""
        with self.lock:
            return any(page.answered >= number for page in self.pages)


class Page(WebSocketHandler):
    """One open page. A newer command replaces one of its key that was not yet sent."""

    def initialize(self, hub: Hub, door: Door) -> None:
        """Store the hub and the conditions of access; called by Tornado."""
        self.hub, self._door = hub, door
        self.has_pending, self._ready = asyncio.Event(), asyncio.Event()
        self._delivery: asyncio.Task[None] | None = None
        # Pages declare compression; a program that reads the scene need not.
        self._unpacks = "gzip" in self.request.query_arguments
        self.answered = 0

    def prepare(self) -> None:
        """Check host and key, and that the connection comes from one of our pages.

        Tornado compares the origin with the host, but accepts connections without an
        origin: those of programs, not of browsers.
        """
        self._door.check(self)
        if "Origin" not in self.request.headers:
            raise HTTPError(403, reason="The connection names no origin")

    def open(self, *args: str, **kwargs: str) -> None:
        """Send the page the stage, which must not wait for meshes, then the rest."""
        try:
            self._begin()
        except BaseException:
            self._leave()
            raise

    def _begin(self) -> None:
        hub = self.hub
        with hub.lock:
            self.pending = hub.scene.copy()
            stage = hub.scene.stage()
            hub.pages.add(self)
        self.ask()
        self._delivery = asyncio.create_task(self._deliver(stage))
        if hub.steerable:
            hub.steering = hub.steering or self
            hub.show_who_steers()

    def on_message(self, message: str | bytes) -> None:
        """Process an answer, or a command of a page that steers; disconnect others."""
        try:
            if message == TAKEN:
                self._ready.set()
            elif str(message).startswith("{") and self.hub.steerable:
                self._hear(str(message))
            else:
                self.answered = max(self.answered, int(message))
        except ValueError as error:
            reason = str(error).encode()[:_LONGEST_REASON].decode(errors="ignore")
            self.close(1008, reason)
        except BaseException:
            self._leave()
            raise

    def _hear(self, text: str) -> None:
        if len(text.encode()) > _LONGEST:
            raise ValueError("the message is too long")
        try:
            message = json.loads(text, parse_constant=_refuse)
        except RecursionError:
            raise ValueError("the message is nested too deeply") from None
        if not isinstance(message, dict) or not isinstance(message.get("do"), str):
            raise ValueError("a message is an object with a text `do`")
        mine = self.hub.steering is self
        if message["do"] == "take_over":
            if not mine:
                self.hub.steer(self)
        elif mine:
            self.hub.receive(message)

    def on_close(self) -> None:
        """Remove the page; if that fails, the server ends, and `failure` has it."""
        try:
            self._remove()
        except BaseException as error:
            self.hub.fail(error)
            raise

    def _remove(self) -> None:
        with self.hub.lock:
            self.hub.pages.discard(self)
        if self._delivery is not None:
            self._delivery.cancel()
        if self.hub.steering is self:
            self.hub.steer(None)

    def _leave(self) -> None:
        """Remove the page where Tornado would not, and disconnect it."""
        try:
            self.on_close()
        finally:
            self.hang_up()

    def ask(self) -> None:
        """Request that the page returns a number once it shows everything sent."""
        self.command("", "ask", type="ask", number=self.hub.asked)

    def command(self, path: str, name: str, **command: Any) -> None:
        """Send a message to this page."""
        packed = pack({"path": path, **command})
        with self.hub.lock:
            self.pending.keep([PageCommand(path, key_of(path, name), packed)])
        self.has_pending.set()

    async def _deliver(self, commands: list[bytes]) -> None:
        """Send the stage, and then the pending commands; disconnect if that fails."""
        try:
            while True:
                for message in batch_messages(commands):
                    if self._unpacks and len(message) > _LARGE:
                        message = await self._compressed(message)
                    self._ready.clear()
                    await self.write_message(message, binary=True)
                    # Meanwhile newer commands replace pending ones.
                    await self._ready.wait()
                await self.has_pending.wait()
                self.has_pending.clear()
                with self.hub.lock:
                    commands = self.pending.pop_all()
        except WebSocketClosedError:
            pass
        finally:
            self.hang_up()  # the page connects anew

    async def _compressed(self, message: bytes) -> bytes:
        """Return a message compressed by another thread; the page detects it."""
        loop = asyncio.get_running_loop()
        return await loop.run_in_executor(None, partial(gzip.compress, message, 4))

    def hang_up(self) -> None:
        """Close the connection at once: the program ends, whatever the page does."""
        if self.ws_connection is not None and self.ws_connection.stream is not None:
            self.ws_connection.stream.close()


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


_LONGEST_QUESTION = 100  # characters


class Alive(RequestHandler):
    """Proves to a page that has lost its program that this server has its key."""

    def initialize(self, door: Door) -> None:
        """Store the conditions of access; called by Tornado."""
        self._door = door

    def prepare(self) -> None:
        """Check the host."""
        self._door.check(self, needs_key=False)

    def get(self) -> None:
        """Answer a question by its HMAC."""
        question = self.get_query_argument("question")[:_LONGEST_QUESTION]
        key = self._door.key.encode()
        self.set_header("Cache-Control", "no-store")
        self.finish(hmac.new(key, question.encode(), "sha256").hexdigest())


_CLOSING = 2.0
"""Longest time in which connections are closed in order [s]."""


class ServerThread:
    """Serves the page, and a hub's commands to pages, until it is closed.

    Attributes:
        failure: The error that ended it; None: none.
    """

    def __init__(self, hub: Hub, door: Door, port: int, meshcat: Path) -> None:
        """Begin to listen; the thread ends with the program."""
        pages = (Path(__file__).parent / "page").iterdir()
        files = {
            file.name: (_TYPES[file.suffix], file.read_bytes())
            for file in (*pages, meshcat / "main.min.js")
        }
        files[""] = files.pop("index.html")
        self._hub = hub
        self._routes: list[Any] = [
            (r"/scene", Page, {"hub": hub, "door": door}),
            (r"/alive", Alive, {"door": door}),
            (r"/(.*)", FileHandler, {"files": files, "door": door}),
        ]
        self._listener = _listen(door.host, port)
        own = self._listener.getsockname()[1]
        self.url = f"http://{door.host}:{own}/?key={door.key}"
        self.failure: BaseException | None = None
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._run, name="page server", daemon=True)
        self._thread.start()

    def call(self, function: Callable[[], object]) -> None:
        """Call a function in the thread, soon; if that has ended, nothing happens."""
        with suppress(RuntimeError):  # its loop is closed
            self._loop.call_soon_threadsafe(function)

    def close(self) -> None:
        """End the thread, and all connections; a second call does nothing."""
        self.call(self._hub.end.set)
        self._thread.join()

    def _run(self) -> None:
        """Serve; after any exception connections are closed, and `failure` has it."""
        try:
            with asyncio.Runner(loop_factory=lambda: self._loop) as runner:
                runner.run(self._serve())
        except BaseException as error:
            self.failure = error
        finally:
            self.failure = self.failure or self._hub.failure
            self._listener.close()
            for page in self._hub.leave():
                page.hang_up()

    async def _serve(self) -> None:
        server = HTTPServer(
            Application(
                self._routes,
                websocket_ping_interval=20,
                websocket_max_message_size=_LONGEST,
            )
        )
        server.add_socket(self._listener)
        await self._hub.end.wait()
        server.stop()
        for page in self._hub.leave():
            page.hang_up()
        with suppress(TimeoutError):  # the loop closes the remaining ones
            await asyncio.wait_for(server.close_all_connections(), _CLOSING)


def _listen(host: str, port: int) -> socket.socket:
    candidates = (port,) if port else PORTS
    for candidate in candidates:
        try:
            check_host_name(host)
            listener = socket.create_server((host, candidate))
        except OSError as error:
            number = error.errno or 0
            if number < 0:  # from the look-up of names, not from the system
                reason = (error.strerror or "").partition(" (while")[0]
                raise OSError(
                    f"cannot listen on {host}: no computer has this name: {reason}"
                ) from None
            reason = os.strerror(number)
        else:
            listener.setblocking(False)
            return listener
    raise OSError(f"cannot listen on {host}:{candidates[-1]}: {reason}")
