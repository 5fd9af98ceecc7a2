"""Targets from other processes: JSON datagrams; a port may be shared by streams."""

import logging
import socket
from collections.abc import Callable, Mapping
from functools import partial
from ipaddress import ip_address
from threading import Lock
from time import monotonic
from typing import Any, NamedTuple
from urllib.parse import urlsplit
from weakref import ref

from hsp_control.common.exceptions import StreamError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import Space, message_of, parsed

SCHEME = "udp://"
_LARGEST = 65_536
_TOGETHER = 2.0  # senders that take turns within this time send at the same time [s]
_JUMP = 1.0  # what a clock goes back, or ahead of ours, that is no delay [s]
_log = logging.getLogger(__name__)
_POLL = 0.2  # how soon a listener notices that nobody needs it any more [s]


class Address(NamedTuple):
    """What an address ``udp://HOST:PORT/PART`` says.

    Attributes:
        host: Where to listen.
        port: The port.
        part: The key of a stream's messages in those of a shared port; "": all.
    """

    host: str
    port: int
    part: str


def address_of(source: str) -> Address | None:
    """Return what an address says; None: it is none."""
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
    """Return what an address ``udp://HOST:PORT`` or ``udp://HOST:PORT/PART`` says."""
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
    """Open the port of an address, if no stream did; return what listens there."""
    address = check_address(source)
    with _lock:
        port = _ports.get(address[:2])
        if port is None:
            port = _ports[address[:2]] = _Port(address)
        parts = [name for name, each in port.parts.items() if not each.is_gone]
        if parts and "" in (*parts, address.part):
            raise StreamError(
                f"{source}: another stream of this process hears all that comes there, "
                "or a part of it; give each its own udp://HOST:PORT/PART"
            )
        port.parts[address.part] = _Part(source)
    return partial(_listen, port, address.part)


class _Part:
    """What one stream hears at a port, and who sends it."""

    def __init__(self, source: str) -> None:
        self._source = source
        self.inbox: Callable[[], Inbox | None] = _nobody
        self._told = {"senders": False, "clock": False}
        self._seen: dict[Any, float] = {}
        self._last: Any = None
        self._newest, self._behind = -float("inf"), float("inf")

    @property
    def is_gone(self) -> bool:
        """Whether its stream is gone, and its thread soon."""
        return self.inbox is not _nobody and self.inbox() is None

    def hear(self, sender: Any, t: object) -> None:
        """Note who has sent now, and its clock; say once what is wrong with them."""
        now, last = monotonic(), self._last
        recent = {s: at for s, at in self._seen.items() if now - at < _TOGETHER}
        if sender in recent and sender != last:
            one, other = (":".join(map(str, each)) for each in (last, sender))
            self._tell(
                "senders", "two senders take turns, %s and %s; their targets and "
                "clocks mix", one, other,
            )  # fmt: skip
        elif sender == last and isinstance(t, int | float):
            self._compare(float(t), now - t)
        if sender != last:
            self._newest, self._behind = -float("inf"), float("inf")
        self._seen, self._last = {**recent, sender: now}, sender

    def _compare(self, t: float, behind: float) -> None:
        """Compare a sender's clock with what it was; ``behind`` ours, it is late."""
        back, ahead = self._newest - t, self._behind - behind
        if back > _JUMP:
            self._tell("clock", "the sender's clock jumps back by %.3g s", back)
        elif _JUMP < ahead < float("inf"):
            self._tell("clock", "the sender's clock jumps ahead by %.3g s", ahead)
        if max(back, ahead) > _JUMP:  # it counts as another clock
            self._newest, self._behind = t, behind
        self._newest, self._behind = max(self._newest, t), min(self._behind, behind)

    def _tell(self, what: str, message: str, *given: object) -> None:
        if not self._told[what]:
            self._told[what] = True
            _log.warning(f"%s: {message}", self._source, *given)


def _nobody() -> Inbox | None:
    """Return no inbox: the stream does not listen yet."""
    return None


class _Port:
    """A port, and the streams of this process that hear what comes there."""

    def __init__(self, address: Address) -> None:
        self.parts: dict[str, _Part] = {}
        self.reading = Lock()
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(address[:2])
        except OSError as error:
            self._socket.close()
            raise StreamError(
                f"{SCHEME}{address.host}:{address.port}: cannot listen there: "
                f"{error.strerror or error}"
            ) from None
        self._socket.settimeout(_POLL)

    def hear(self) -> None:
        """Wait for a datagram; give each stream its part, or none if one is invalid."""
        try:
            text, sender = self._socket.recvfrom(_LARGEST)
        except OSError:  # nothing came
            return
        parts = dict(self.parts)
        there = {name: inbox for name, each in parts.items() if (inbox := each.inbox())}
        try:
            heard = _parts_of(text, there)
        except StreamError as error:
            for inbox in there.values():
                inbox.reject(str(error))
            heard = {name: {} for name in there}
        for name, message in heard.items():
            parts[name].hear(sender, message.get("t"))
            if message:
                there[name].put(**message)

    def close(self) -> None:
        """Close the port."""
        self._socket.close()


def _parts_of(text: bytes, inboxes: Mapping[str, Inbox]) -> dict[str, dict[str, Any]]:
    """Return what each stream hears of a datagram; all of it is valid."""
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
                f"no stream of this port is {name!r:.40}{did_you_mean(name, inboxes)}"
            )
        if isinstance(message, Mapping):
            message = {"t": data.get("t"), **message}
        try:
            message_of(message, inboxes[name].space)
        except StreamError as error:
            raise StreamError(f"{name}: {error}") from None
        found[name] = message
    return found


_ports: dict[tuple[str, int], _Port] = {}
_lock = Lock()


def _listen(port: _Port, part: str, inbox: "ref[Inbox]") -> None:
    """Hear what comes for as long as an inbox is there, in turn with the others."""
    port.parts[part].inbox = inbox
    while inbox() is not None:
        if port.reading.acquire(timeout=_POLL):
            try:
                port.hear()
            finally:
                port.reading.release()
    with _lock:
        del port.parts[part]
        if not port.parts:
            port.close()
            _ports.pop(next(key for key, each in _ports.items() if each is port))
