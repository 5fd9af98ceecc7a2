"""Transports of commands: into a stored scene and, with a server, to its pages."""

import atexit
import importlib.util
import logging
import os
import secrets
import sys
import tempfile
import threading
import time
import webbrowser
from collections.abc import Iterable
from contextlib import suppress
from html import escape
from ipaddress import ip_address
from pathlib import Path
from typing import Any

from hsp_control.common.errors import ViewerError
from hsp_control.companions.viewer.commands import (
    LatestCommands,
    PageCommand,
)
from hsp_control.live.hardware import described


class SceneRecorder:
    """Stores the commands that build a scene: everything that a viewer needs to draw.

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
        self.scene.keep(commands)

    def wait_for_page(self, timeout: float) -> bool:
        """Wait until a page shows everything sent; return whether one does."""
        return False

    def wait_until_closed(self) -> None:
        """Wait until no page is open any more."""

    def close(self) -> None:
        """End the server, if there is one; the commands remain."""


_log = logging.getLogger(__name__)


def open_browser(url: str) -> bool:
    """Open a page in the user's browser; return whether there is one."""
    reason = _why_not()
    if reason is not None:
        _log.warning("%s; the view is at %s", reason, url)
        return False
    threading.Thread(target=_open, args=(url,), daemon=True).start()
    return True


def _open(url: str) -> None:
    """Open a page through a file that redirects there: all users can see arguments."""
    file = _leading_to(url)
    webbrowser.open(url if file is None else file.as_uri(), 2)
    if file is not None:
        time.sleep(_READ)
        file.unlink(missing_ok=True)


_READ = 30.0  # time in which a browser has read the file [s]


def _leading_to(url: str) -> Path | None:
    """Return a file that only this user can read, and that leads to a page."""
    page = (
        '<!DOCTYPE html><meta charset="utf-8"><title>hsp_control</title>'
        f'<meta http-equiv="refresh" content="0;url={escape(url)}">'
    )
    try:
        own = os.environ.get("XDG_DATA_HOME") or Path.home() / ".local" / "share"
        folder = Path(own) / "hsp_control"  # as Jupyter does
        folder.mkdir(parents=True, exist_ok=True)
        number, name = tempfile.mkstemp(".html", "open-", folder)  # mode 0600
        with os.fdopen(number, "w") as file:
            file.write(page)
    except (OSError, RuntimeError):  # it cannot be written
        return None
    atexit.register(
        Path(name).unlink, missing_ok=True
    )  # if the program ends before that
    return Path(name)


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
RELOAD_TIMEOUT = 3.0  # s; a page that reconnects within it was reloaded
_POLL = 0.05  # s


class PageServer(SceneRecorder):
    """A server for the page, see `page_server`: a thread that ends with the program."""

    def __init__(
        self,
        port: int | None = None,
        *,
        host: str = LOOPBACK,
        steerable: bool = False,
        fresh: bool = False,
    ) -> None:
        """Begin to listen; ``fresh``: with a key that no earlier page has."""
        # Here: Tornado is only needed where there is a page.
        from hsp_control.companions.viewer.page_server import Door, Hub, ServerThread

        if port is not None and not 1 <= port <= 65535:
            raise ViewerError(f"port {port} is not between 1 and 65535")
        if host in {"", "0.0.0.0"}:
            raise ViewerError(
                f"host {host!r} is every address of this computer; give the one at "
                "which the page is opened, such as 192.168.1.20"
            )
        check_unicast(host)
        super().__init__()
        self._hub = Hub(self.scene, steerable=steerable)
        door, meshcat = Door(host, page_key(host, fresh=fresh)), meshcat_page()
        try:
            self._thread = ServerThread(self._hub, door, port or 0, meshcat)
        except OSError as error:
            raise ViewerError(f"the viewer's server cannot start: {error}") from error
        self.url = self._thread.url
        self._closed = False

    def send(self, commands: Iterable[PageCommand]) -> None:
        """Send commands, to be shown together; never waits for a page."""
        self._check_open()
        self._hub.keep(commands)
        self._thread.call(self._hub.notify)

    def messages(self) -> list[dict[str, Any]]:
        """Return the steering page's messages since the last call; never waits.

        Only the newest of a kind and object: no page can delay the program.
        """
        self._check_open()
        with self._hub.lock:
            found = list(self._hub.received.values())
            self._hub.received.clear()
        return found

    def wait_for_page(self, timeout: float) -> bool:
        """Wait until a page shows everything sent; return whether one does."""
        self._check_open()
        deadline = time.monotonic() + timeout
        number = self._hub.asked = self._hub.asked + 1
        self._thread.call(self._hub.ask)
        while not self._hub.up_to_date(number):
            if time.monotonic() >= deadline:
                return False
            time.sleep(_POLL)
        return True

    def wait_until_closed(self) -> None:
        """Wait until no page is open; one that is being reloaded is still open."""
        last_seen = time.monotonic()
        while time.monotonic() < last_seen + RELOAD_TIMEOUT:
            if self._hub.pages:
                last_seen = time.monotonic()
            time.sleep(RELOAD_TIMEOUT / 6.0)

    def close(self) -> None:
        """End the thread; a second call has no effect."""
        self._closed = True
        self._thread.close()

    def _check_open(self) -> None:
        if self._closed:
            raise ViewerError("the viewer is closed")
        if (failure := self._thread.failure) is not None:
            raise ViewerError(f"the page's server has failed: {described(failure)}")


def check_unicast(host: str) -> None:
    """Check that an address, if it is no name, can be one computer's, and is IPv4's.

    Raises:
        ViewerError: If it is none of these.
    """
    try:
        address = ip_address(host)
    except ValueError:  # a name
        return
    if address.version != 4:
        raise ViewerError(f"host {host!r} is an IPv6 address; give an IPv4 address")
    if address.is_multicast or address.is_reserved:
        raise ViewerError(
            f"host {host!r} is the address of many computers; give the one of this "
            "computer at which the page is opened, such as 192.168.1.20"
        )


def page_key(host: str, *, fresh: bool = False) -> str:
    """Return the key that a page's address must contain.

    On this computer it is the user's, in a file that no other user can read, so that an
    open page finds the next start. In a network, or if it is to be ``fresh``, it is new
    at every start.
    """
    new = secrets.token_urlsafe(16)
    if fresh or host != LOOPBACK:
        return new
    try:
        cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        file = Path(cache) / "hsp_control" / "page-key"
        file.parent.mkdir(parents=True, exist_ok=True)
        if not file.exists():
            _write_once(file, new)
        about, kept = file.stat(), file.read_text()
    except (OSError, RuntimeError, UnicodeDecodeError):  # it cannot be written
        return new
    private = about.st_uid == os.getuid() and not about.st_mode & 0o077
    return kept if private and len(kept) == len(new) else new


def _write_once(file: Path, text: str) -> None:
    """Write a file for this user alone, whole or not at all, if there is none."""
    with tempfile.NamedTemporaryFile("w", dir=file.parent) as draft:
        draft.write(text)
        draft.flush()
        with suppress(FileExistsError):  # of another start at this moment
            os.link(draft.name, file)


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
