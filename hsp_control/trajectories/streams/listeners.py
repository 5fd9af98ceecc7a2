"""Streams from other processes: who listens where, once in a process."""

from collections.abc import Callable
from threading import Thread
from typing import Protocol
from weakref import WeakValueDictionary, ref

from hsp_control.common.entry_points import entry_points
from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import Space

Listen = Callable[["ref[Inbox]"], None]
"""Puts what it hears into an inbox for as long as that is there."""


class Kind(Protocol):
    """A kind of address: a module, an entry point of ``hsp_control.targets``."""

    def check_address(self, source: str) -> object:
        """Raise if the address is invalid."""

    def is_local(self, source: str) -> bool:
        """Return whether only this computer can send to it."""

    def opened(self, source: str, space: Space) -> Listen:
        """Open it."""


_inboxes: WeakValueDictionary[str, Inbox] = WeakValueDictionary()
_threads: dict[str, Thread] = {}


def is_address(source: str) -> bool:
    """Return whether a source is another process, not a recording."""
    return "://" in source


def check_address(source: str) -> None:
    """Check an address ``udp://HOST:PORT`` or ``ros2://TOPIC``."""
    _kind(source).check_address(source)


def is_local(source: str) -> bool:
    """Return whether only this computer can send to an address."""
    return _kind(source).is_local(source)


def listening_inbox(source: str, space: Space) -> Inbox:
    """Return the inbox of an address, one per process; unused, it closes."""
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
    listen = _kind(source).opened(source, space)
    inbox = Inbox(space)
    _inboxes[source] = inbox
    _threads[source] = Thread(
        target=listen, args=(ref(inbox),), name=f"stream {source}", daemon=True
    )
    _threads[source].start()
    return inbox


def _kind(source: str) -> Kind:
    kinds = entry_points("targets")
    if found := kinds.get(source.partition("://")[0]):
        kind: Kind = found.load()
        return kind
    schemes = " or ".join(f"{name}://" for name in sorted(kinds)) or "none"
    raise StreamError(
        f"source is {source!r}; an address begins with {schemes}, and the path of a "
        "recording contains no '://'"
    )
