"""Where commands go: into a scene that is kept and, with a server, to its pages."""

import atexit
import importlib.util
import json
import logging
import os
import secrets
import select
import subprocess
import sys
import threading
import time
import webbrowser
from collections import deque
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ViewerError
from hsp_control.visualization.viewer.commands import Json, PageCommand, unpack
from hsp_control.visualization.viewer.pipe import (
    ASK,
    DELETE,
    SET,
    LatestCommands,
    PipeRecord,
    encode,
    key_of,
    newest,
)


class SceneRecorder:
    """Keeps the commands that build a scene: all that a viewer needs to draw.

    Attributes:
        scene: The commands.
        url: The address of the page that shows it; None without a server.
    """

    def __init__(self) -> None:
        """Start with an empty scene."""
        self.scene = LatestCommands()
        self.url: str | None = None

    def send(self, commands: Iterable[PageCommand]) -> None:
        """Send commands, to be shown together."""
        for command in commands:
            command.keep_in(self.scene)

    def wait_for_page(self, timeout: float) -> bool:
        """Wait until a page shows all that was sent; return whether one does."""
        return False

    def wait_until_closed(self) -> None:
        """Wait until no page is open any more."""

    def close(self) -> None:
        """End the server, if there is one; the commands remain."""

    def paths(self, below: str = "") -> list[str]:
        """Return the paths of all objects that begin with ``below``."""
        return [
            path
            for path, name, _ in self.scene.items()
            if name == "object" and path.startswith(below)
        ]

    def command(self, path: str, name: str) -> Json | None:
        """Return the command that set the property ``name`` of a node, or None."""
        packed = self.scene.get(key_of(path, name))
        return None if packed is None else unpack(packed)

    def transform(self, path: str) -> Array:
        """Return the pose of a node in the world, shape (4, 4)."""
        total: Array = np.eye(4)
        nodes = path.split("/")
        for depth in range(2, len(nodes) + 1):
            command = self.command("/".join(nodes[:depth]), "transform")
            if command is not None:
                matrix: Any = command["matrix"]
                total = total @ np.reshape(matrix, (4, 4)).T
        return total


_log = logging.getLogger(__name__)


def open_browser(url: str) -> bool:
    """Open a page in the user's browser; return whether there is one."""
    reason = _why_not()
    if reason is not None:
        _log.warning("%s; the view is at %s", reason, url)
        return False
    threading.Thread(target=webbrowser.open, args=(url, 2), daemon=True).start()
    return True


def _why_not() -> str | None:
    """Return why no browser can be opened; None if one can."""
    chosen = "BROWSER" in os.environ
    display = os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY"}
    if sys.platform.startswith("linux") and not (display or chosen):
        return "there is no display to open a browser on"
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return "there is no browser to open"
    if type(browser) is webbrowser.GenericBrowser and not chosen:
        return f"{browser.name} would take over the terminal"
    return None


LOOPBACK = "127.0.0.1"
START_TIMEOUT = 30.0  # s; it takes 0.2 on an idle machine
STALL_TIMEOUT = 5.0  # s without progress after which the server counts as dead
RELOAD_TIMEOUT = 3.0  # s; a page that reconnects within it was reloaded
_POLL = 0.05  # s

# The process imports a few modules of this package, without the package's __init__.
_LAUNCH = """
import json, sys, types
viewer, meshcat, port, parent, host, steerable = sys.argv[1:]
for name in ("hsp_control", "hsp_control.visualization.viewer"):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__path__ = [viewer]
try:
    from hsp_control.visualization.viewer.page_server import main
    main(meshcat, int(port), int(parent), host, bool(steerable))
except Exception as error:
    print(json.dumps({"error": str(error) or repr(error)}), flush=True)
"""


class PageServer(SceneRecorder):
    """The server's process, see `page_server`; it ends with this process."""

    def __init__(
        self, port: int | None = None, *, host: str = LOOPBACK, steerable: bool = False
    ) -> None:
        """Start the process."""
        if port is not None and not 1 <= port <= 65535:
            raise ViewerError(f"port {port} is not between 1 and 65535")
        if host in {"", "0.0.0.0"}:
            raise ViewerError(
                f"host {host!r} is every address of this computer; give the one at "
                "which the page is opened, such as 192.168.1.20"
            )
        super().__init__()
        self._lock = threading.Lock()
        self._unsent = b""
        self._answers = b""
        self._asked = 0
        self._messages: deque[dict[str, Any]] = deque()
        folder, steers = Path(__file__).parent, "yes" if steerable else ""
        arguments = [folder, meshcat_page(), port or 0, os.getpid(), host, steers]
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", _LAUNCH, *map(str, arguments)],
            env={**os.environ, "HSP_PAGE_KEY": page_key(host)},
            bufsize=0,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # an unread pipe would block it
            start_new_session=True,  # Ctrl-C reaches only this process
        )
        atexit.register(self.close)
        try:
            assert self.process.stdin is not None
            os.set_blocking(self.process.stdin.fileno(), False)
            self.url = self._answer(time.monotonic() + START_TIMEOUT)["url"]
        except BaseException:
            self.close()
            raise

    def send(self, commands: Iterable[PageCommand]) -> None:
        """Send commands, to be shown together."""
        commands = list(commands)
        records = [
            PipeRecord(DELETE, command.path, command.packed)
            if command.deletes
            else PipeRecord(SET, command.key, command.packed)
            for command in commands
        ]
        with self._lock:
            self._write(b"".join(map(encode, records)))
            super().send(commands)

    def messages(self) -> list[dict[str, Any]]:
        """Return the steering page's messages since the last call; never waits.

        Of each kind and object it is the newest: no page holds the program up.
        """
        with self._lock:
            if self.process.stdout is None or self.process.stdout.closed:
                raise ViewerError("the viewer is closed")
            descriptor = self.process.stdout.fileno()
            while _wait(descriptor, select.POLLIN, 0.0):
                self._read(descriptor)
            *lines, self._answers = self._answers.split(b"\n")
            self._messages.extend(json.loads(line)["message"] for line in lines)
            found = newest(self._messages)
            self._messages.clear()
        return [dict(message) for message in found.values()]

    def wait_for_page(self, timeout: float) -> bool:
        """Wait until a page shows all that was sent; return whether one does."""
        deadline = time.monotonic() + timeout
        self._asked += 1
        while True:
            answer = self._ask()
            if answer["number"] == self._asked and answer["up_to_date"]:
                return True
            if time.monotonic() >= deadline:
                return False
            time.sleep(_POLL)

    def wait_until_closed(self) -> None:
        """Wait until no page is open; a page that is reloaded counts as open."""
        last_seen = time.monotonic()
        while time.monotonic() < last_seen + RELOAD_TIMEOUT:
            if self._ask()["pages"]:
                last_seen = time.monotonic()
            time.sleep(RELOAD_TIMEOUT / 6.0)

    def close(self) -> None:
        """End the process; a second call has no effect."""
        atexit.unregister(self.close)
        process = self.process
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()  # the process ends when its input is closed
        try:
            process.wait(2.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _ask(self) -> dict[str, Any]:
        """Return how many pages are open, and how many show all sent before."""
        with self._lock:
            self._write(encode(PipeRecord(ASK, str(self._asked))))
            return self._answer(time.monotonic() + STALL_TIMEOUT)

    def _write(self, data: bytes) -> None:
        pipe = self.process.stdin
        if pipe is None or pipe.closed:
            raise ViewerError("the viewer is closed")
        descriptor = pipe.fileno()
        rest = memoryview(self._unsent + data)
        try:
            while rest:
                if not _wait(descriptor, select.POLLOUT, STALL_TIMEOUT):
                    self._fail(f"has not read its input for {STALL_TIMEOUT:g} s")
                with suppress(BlockingIOError):
                    rest = rest[os.write(descriptor, rest) :]
        except OSError as error:
            self._fail(f"has ended ({error.strerror})")
        finally:
            # Not empty after Ctrl-C: no record is cut in two.
            self._unsent = bytes(rest)

    def _answer(self, deadline: float) -> dict[str, Any]:
        """Return the process's next answer; messages that come before it are kept."""
        assert self.process.stdout is not None
        descriptor = self.process.stdout.fileno()
        while True:
            while b"\n" not in self._answers:
                if not _wait(descriptor, select.POLLIN, deadline - time.monotonic()):
                    self._fail("does not answer")
                self._read(descriptor)
            line, _, self._answers = self._answers.partition(b"\n")
            answer: dict[str, Any] = json.loads(line)
            if "error" in answer:
                raise ViewerError(
                    f"the viewer's server cannot start: {answer['error']}"
                )
            if "message" not in answer:
                return answer
            self._messages.append(answer["message"])

    def _read(self, descriptor: int) -> None:
        data = os.read(descriptor, 1 << 16)
        if not data:
            self._fail("has ended")
        self._answers += data

    def _fail(self, reason: str) -> None:
        self.process.kill()
        self.close()
        raise ViewerError(f"the viewer's server {reason}; open a new viewer")


def page_key(host: str) -> str:
    """Return what a page's address must contain.

    On this computer it is the user's, in a file that nobody else can read, so that an
    open page finds the next start. In a network it is new at each start.
    """
    fresh = secrets.token_urlsafe(16)
    if host != LOOPBACK:
        return fresh
    try:
        cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        file = Path(cache) / "hsp_control" / "page-key"
        file.parent.mkdir(parents=True, exist_ok=True)
        with suppress(FileExistsError):
            opened = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            os.write(opened, fresh.encode())
            os.close(opened)
        about, kept = file.stat(), file.read_text()
    except (OSError, RuntimeError, UnicodeDecodeError):  # no place for it
        return fresh
    private = about.st_uid == os.getuid() and not about.st_mode & 0o077
    return kept if private and len(kept) == len(fresh) else fresh


def _wait(descriptor: int, event: int, timeout: float) -> bool:
    """Wait until a pipe is ready, at most ``timeout`` [s]; return whether it is."""
    poll = select.poll()
    poll.register(descriptor, event)
    return bool(poll.poll(max(0.0, 1000.0 * timeout)))


def meshcat_page() -> Path:
    """Return the folder of Meshcat's page, without importing Meshcat."""
    spec = importlib.util.find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise ViewerError(
            "the view needs meshcat; install it with: pip install meshcat"
        )
    folder = Path(spec.origin).parent / "viewer" / "dist"
    if not (folder / "main.min.js").is_file():
        raise ViewerError(
            f"meshcat is installed without its page ({folder / 'main.min.js'}); "
            "reinstall it with: pip install --force-reinstall meshcat"
        )
    return folder
