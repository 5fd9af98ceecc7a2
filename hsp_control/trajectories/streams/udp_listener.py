"""Messages from other processes: JSON datagrams, received by a thread."""

import socket
from threading import Thread
from urllib.parse import urlsplit
from weakref import WeakValueDictionary, ref

from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import Space

SCHEME = "udp://"
_LARGEST = 65_536
_POLL = 0.2
"""How soon a listener notices that nobody needs it any more [s]."""


def check_address(source: str) -> tuple[str, int]:
    """Return host and port of an address ``udp://host:port``.

    Raises:
        StreamError: If it is none.
    """
    try:
        parts = urlsplit(source)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    plain = source == f"{SCHEME}{host}:{port}"
    if not (source.startswith(SCHEME) and host and port and plain):
        raise StreamError(
            f"source is {source!r}; needs udp://HOST:PORT, for example "
            "udp://127.0.0.1:5005, or the path of a recording"
        )
    return host, port


def listening_inbox(source: str, space: Space) -> Inbox:
    """Return the inbox of an address; all streams of one process share it.

    The thread ends, and the port is free again, when nobody uses the inbox any more.

    Raises:
        StreamError: If the address is wrong or in use, or another stream of this
            process receives other values there.
    """
    known = _inboxes.get(source)
    if known is not None:
        if known.space != space:
            raise StreamError(
                f"{source} already carries {known.space.width} numbers; this stream "
                f"needs {space.width}"
            )
        return known
    if source in _threads:  # of an inbox that nobody uses: the port is soon free
        _threads[source].join()
    opened = _open(source)
    inbox = Inbox(space)
    _inboxes[source] = inbox
    _threads[source] = Thread(
        target=_listen, args=(opened, ref(inbox)), name=f"stream {source}", daemon=True
    )
    _threads[source].start()
    return inbox


_inboxes: WeakValueDictionary[str, Inbox] = WeakValueDictionary()
_threads: dict[str, Thread] = {}


def _open(source: str) -> socket.socket:
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
    return opened


def _listen(opened: socket.socket, inbox: "ref[Inbox]") -> None:
    """Put every datagram into the inbox for as long as it is there."""
    with opened:
        while inbox() is not None:
            try:
                text = opened.recv(_LARGEST)
            except TimeoutError:
                continue
            except OSError:
                return
            there = inbox()
            if there is not None:
                there.put_text(text)
            del there
