"""Targets from other processes: JSON datagrams; a port may be shared by streams."""

import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from ipaddress import ip_address
from threading import Lock
from time import monotonic
from typing import Any, NamedTuple
from urllib.parse import urlsplit
from weakref import ref

from hsp_control.common.errors import StreamError
from hsp_control.common.host_names import check_host_name
from hsp_control.common.suggestions import did_you_mean
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import Space, message_of, parsed

SCHEME = "udp://"
_LARGEST = 65_536
_POLL = 0.2  # time until a listener notices that its streams are gone [s]


class Address(NamedTuple):
    """The parts of an address ``udp://HOST:PORT/PART``.

    Attributes:
        host: Where to listen.
        port: The port.
        part: The key of a stream's messages in those of a shared port; "": all.
    """

    host: str
    port: int
    part: str


def address_of(source: str) -> Address | None:
    """Parse an address; None if it is invalid."""
    try:
        parts = urlsplit(source)
        host, port = parts.hostname, parts.port
    except ValueError:
        return None
    part = parts.path.removeprefix("/")
    plain = f"{SCHEME}{host}:{port}" + (f"/{part}" if part else "")
    if host and port and source == plain and (not part or part.isidentifier()):
        return Address(host, port, part)
    return None


def check_address(source: str) -> Address:
    """Parse an address ``udp://HOST:PORT`` or ``udp://HOST:PORT/PART``."""
    if (found := address_of(source)) is None:
        raise StreamError(
            f"source is {source!r}; needs udp://HOST:PORT, for example "
            "udp://127.0.0.1:5005, or the path of a recording"
        )
    return found


def is_local(source: str) -> bool:
    """Return whether only this computer can send to an address."""
    host = check_address(source).host
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def opened(source: str, space: Space) -> Callable[["ref[Inbox]"], None]:
    """Open the port of an address, if no stream did; return its listener."""
    address = check_address(source)
    with _lock:
        port = _ports.get(address[:2])
        if port is None:
            port = _ports[address[:2]] = _Port(address)
        parts = [name for name, each in port.parts.items() if not each or each()]
        if parts and "" in (*parts, address.part):
            raise StreamError(
                f"{source}: another stream of this process listens there already; "
                "give each its own udp://HOST:PORT/PART"
            )
        port.parts[address.part] = None
    return partial(_listen, port, address.part)


class _Port:
    """A port, and the streams of this process that receive its datagrams."""

    def __init__(self, address: Address) -> None:
        self.parts: dict[str, ref[Inbox] | None] = {}  # None: it is about to listen
        self.reading = Lock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            check_host_name(address.host)
            self._socket.bind(address[:2])
        except OSError as error:
            self._socket.close()
            raise StreamError(
                f"{SCHEME}{address.host}:{address.port}: cannot listen there: "
                f"{error.strerror or error}"
            ) from None
        self._socket.settimeout(_POLL)

    def poll(self) -> None:
        """Wait for a datagram; pass each stream its part, or none if one is refused."""
        text: bytes | None = None
        with suppress(OSError):  # no datagram
            text, (host, port) = self._socket.recvfrom(_LARGEST)
        parts, now = dict(self.parts), monotonic()
        there = {
            name: inbox for name, each in parts.items() if each and (inbox := each())
        }
        for inbox in there.values():
            inbox.note_silence(now)
        if text is None:
            return
        sender = f"{host}:{port}"
        try:
            messages = _parts_of(text, there)
            for name in messages:
                with _naming(name):
                    there[name].check_sender(sender, now)
        except StreamError as error:
            for k, inbox in enumerate(there.values()):
                inbox.reject(str(error), aloud=k == 0)
            return
        for name, message in messages.items():
            there[name].receive(sender, now, message)

    def close(self) -> None:
        """Close the port."""
        self._socket.close()


def _parts_of(text: bytes, inboxes: Mapping[str, Inbox]) -> dict[str, dict[str, Any]]:
    """Return the streams' parts of a valid datagram."""
    try:
        data = parsed(text)
    except (ValueError, RecursionError) as error:
        raise StreamError(f"a message is not JSON: {error}") from None
    if "" in inboxes:
        message_of(data, inboxes[""].space)
        return {"": data}
    if not isinstance(data, Mapping):
        raise StreamError("a message to several streams needs a mapping")
    found = {}
    for name, message in data.items():
        if name == "t":
            continue
        if name not in inboxes:
            raise StreamError(
                f"no stream of this port is called {name!r:.40}"
                f"{did_you_mean(name, inboxes)}"
            )
        if isinstance(message, Mapping):
            message = {"t": data.get("t"), **message}
        with _naming(name):
            message_of(message, inboxes[name].space)
        found[name] = message
    return found


@contextmanager
def _naming(part: str) -> Iterator[None]:
    """Prefix errors with a part's name."""
    try:
        yield
    except StreamError as error:
        raise StreamError(f"{part}: {error}" if part else str(error)) from None


_ports: dict[tuple[str, int], _Port] = {}
_lock = Lock()


def _listen(port: _Port, part: str, inbox: "ref[Inbox]") -> None:
    """Receive datagrams while an inbox exists, in turn with the other listeners."""
    port.parts[part] = inbox
    try:
        while inbox() is not None:
            if port.reading.acquire(timeout=_POLL):
                try:
                    port.poll()
                finally:
                    port.reading.release()
    finally:
        with _lock:
            del port.parts[part]
            if not port.parts:
                port.close()
                _ports.pop(next(key for key, each in _ports.items() if each is port))
