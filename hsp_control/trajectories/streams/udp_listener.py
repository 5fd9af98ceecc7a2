"""Messages from other processes: JSON datagrams."""

import logging
import socket
from collections.abc import Callable
from functools import partial
from ipaddress import ip_address
from time import monotonic
from typing import Any
from urllib.parse import urlsplit
from weakref import ref

from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import Space

SCHEME = "udp://"
_LARGEST = 65_536
_TOGETHER = 2.0  # senders that take turns within this time send at the same time [s]
_log = logging.getLogger(__name__)
_POLL = 0.2  # how soon a listener notices that nobody needs it any more [s]


def host_and_port(source: str) -> tuple[str, int] | None:
    """Return host and port of an address ``udp://host:port``; None: it is none."""
    try:
        parts = urlsplit(source)
        host, port = parts.hostname, parts.port
    except ValueError:
        return None
    if host and port and source == f"{SCHEME}{host}:{port}":
        return host, port
    return None


def check_address(source: str) -> tuple[str, int]:
    """Return host and port of an address ``udp://host:port``."""
    if (found := host_and_port(source)) is None:
        raise StreamError(
            f"source is {source!r}; needs udp://HOST:PORT, for example "
            "udp://127.0.0.1:5005, or the path of a recording"
        )
    return found


def is_local(source: str) -> bool:
    """Return whether only this computer can send to an address."""
    host, _ = check_address(source)
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def opened(source: str, space: Space) -> Callable[["ref[Inbox]"], None]:
    """Open the port of an address; return what listens there."""
    host, port = check_address(source)
    opened = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        opened.bind((host, port))
    except OSError as error:
        opened.close()
        raise StreamError(
            f"{source}: cannot listen there: {error.strerror or error}"
        ) from None
    opened.settimeout(_POLL)
    return partial(_listen, source, opened)


class _Senders:
    """Who has sent, to say once that there are two at the same time."""

    def __init__(self, source: str) -> None:
        self._source, self._told = source, False
        self._seen: dict[Any, float] = {}
        self._last: Any = None

    def hear(self, sender: Any) -> None:
        """Note who has sent now."""
        now, last = monotonic(), self._last
        recent = {s: t for s, t in self._seen.items() if now - t < _TOGETHER}
        if sender in recent and sender != last and not self._told:
            self._told = True
            one, other = (":".join(map(str, each)) for each in (last, sender))
            _log.warning(
                "%s: two senders take turns, %s and %s; their targets and clocks mix",
                self._source, one, other,
            )  # fmt: skip
        self._seen, self._last = {**recent, sender: now}, sender


def _listen(source: str, opened: socket.socket, inbox: "ref[Inbox]") -> None:
    """Put every datagram into the inbox for as long as it is there."""
    senders = _Senders(source)
    with opened:
        while inbox() is not None:
            try:
                text, sender = opened.recvfrom(_LARGEST)
            except TimeoutError:
                continue
            except OSError:
                return
            there = inbox()
            if there is not None:
                senders.hear(sender)
                there.put_text(text)
            del there
