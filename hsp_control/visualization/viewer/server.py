"""Starts the server's process, and talks to it."""

import atexit
import importlib.util
import json
import os
import select
import subprocess
import sys
import threading
import time
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any

from hsp_control.common.exceptions import ViewerError
from hsp_control.visualization.viewer.commands import Command
from hsp_control.visualization.viewer.records import ASK, DELETE, SET, Record, encode

START_TIMEOUT = 30.0  # s; it takes 0.2 on an idle machine
STALL_TIMEOUT = 5.0  # s without progress after which the server counts as dead
RELOAD_TIMEOUT = 3.0  # s; a page that comes back within it was not closed
_POLL = 0.05  # s

# The process needs two modules of this package, and none of what the package imports.
_LAUNCH = """
import json, sys, types
viewer, meshcat, port, parent = sys.argv[1:]
for name in ("hsp_control", "hsp_control.visualization.viewer"):
    sys.modules[name] = types.ModuleType(name)
    sys.modules[name].__path__ = [viewer]
try:
    from hsp_control.visualization.viewer.page_server import main
    main(meshcat, int(port), int(parent))
except Exception as error:
    print(json.dumps({"error": str(error) or repr(error)}), flush=True)
"""


class Server:
    """A server's process that is ours alone; see `page_server`.

    It listens on 127.0.0.1 and ends with `close`, with this process, or when this
    process is killed.

    Attributes:
        url: The page's address.
        process: The process.
    """

    def __init__(self, port: int | None = None) -> None:
        """Start it.

        Args:
            port: The port to listen on; None: the first free one from 7000.

        Raises:
            ViewerError: If Meshcat is not installed, the port is taken, or the process
                does not start.
        """
        if port is not None and not 1 <= port <= 65535:
            raise ViewerError(f"port {port} is not between 1 and 65535")
        self.url: str | None = None
        self._lock = threading.Lock()
        self._unsent = b""
        self._answers = b""
        self._asked = 0
        arguments = [Path(__file__).parent, meshcat_page(), port or 0, os.getpid()]
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", _LAUNCH, *map(str, arguments)],
            bufsize=0,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,  # a pipe that nobody reads would stop it
            start_new_session=True,  # Ctrl-C is for us, who then end it
        )
        atexit.register(self.close)
        try:
            assert self.process.stdin is not None
            os.set_blocking(self.process.stdin.fileno(), False)
            self.url = self._answer(time.monotonic() + START_TIMEOUT)["url"]
        except BaseException:
            self.close()
            raise

    def send(self, commands: Iterable[Command]) -> None:
        """Send commands, to be shown together.

        Raises:
            ViewerError: If the server has ended, or takes nothing any more.
        """
        records = [
            Record(DELETE, command.path, command.packed)
            if command.deletes
            else Record(SET, command.key, command.packed)
            for command in commands
        ]
        with self._lock:
            self._write(b"".join(map(encode, records)))

    def wait_for_page(self, timeout: float) -> bool:
        """Wait until a page shows all that was sent; return whether one does.

        Args:
            timeout: How long at most [s].

        Raises:
            ViewerError: If the server has ended, or does not answer.
        """
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
        """Wait until no page is open any more; one that is loaded again stays open.

        Raises:
            ViewerError: If the server has ended, or does not answer.
        """
        last_seen = time.monotonic()
        while time.monotonic() < last_seen + RELOAD_TIMEOUT:
            if self._ask()["pages"]:
                last_seen = time.monotonic()
            time.sleep(RELOAD_TIMEOUT / 6.0)

    def close(self) -> None:
        """End the process; again is no error."""
        atexit.unregister(self.close)
        process = self.process
        for pipe in (process.stdin, process.stdout):
            if pipe is not None:
                pipe.close()  # it ends when its input does
        try:
            process.wait(2.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _ask(self) -> dict[str, Any]:
        """Return how many pages are open, and how many show all before the question."""
        with self._lock:
            self._write(encode(Record(ASK, str(self._asked))))
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
                    self._give_up(f"takes nothing for {STALL_TIMEOUT:g} s")
                with suppress(BlockingIOError):
                    rest = rest[os.write(descriptor, rest) :]
        except OSError as error:
            self._give_up(f"has ended ({error.strerror})")
        finally:
            self._unsent = bytes(rest)  # some, if Ctrl-C came: no record is cut

    def _answer(self, deadline: float) -> dict[str, Any]:
        """Return its next line."""
        assert self.process.stdout is not None
        descriptor = self.process.stdout.fileno()
        while b"\n" not in self._answers:
            if not _wait(descriptor, select.POLLIN, deadline - time.monotonic()):
                self._give_up("does not answer")
            data = os.read(descriptor, 4096)
            if not data:
                self._give_up("has ended")
            self._answers += data
        line, _, self._answers = self._answers.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise ViewerError(f"the viewer's server cannot start: {answer['error']}")
        return answer

    def _give_up(self, what: str) -> None:
        self.process.kill()
        self.close()
        raise ViewerError(f"the viewer's server {what}; open a new viewer")


def _wait(descriptor: int, event: int, timeout: float) -> bool:
    """Wait until a pipe can be written or read [s]; return whether it can."""
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
