"""Where a stream's messages come from: `send`, another process, or a recording."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from threading import Thread
from typing import Any, Protocol
from weakref import WeakValueDictionary, ref

from hsp_control.common.entry_points import entry_points
from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.inbox import Inbox, InboxReader, InboxRecord
from hsp_control.trajectories.streams.message import Message, Space, message_of, parsed

Listen = Callable[["ref[Inbox]"], None]
"""Puts what it hears into an inbox for as long as that is there."""


class AddressKind(Protocol):
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


def listening_inbox(source: str, space: Space) -> Inbox:
    """Return the inbox of an address, one per process; unused, it closes."""
    known = _inboxes.get(source)
    if known is not None and not known.failure:
        if known.space != space:
            raise StreamError(
                f"{source} already carries {known.space.width} numbers; this stream "
                f"needs {space.width}"
            )
        return known
    if source in _threads:  # of an inbox that nobody uses: the port is soon free
        _threads[source].join()
    listen = kind_of(source).opened(source, space)
    inbox = Inbox(space, source)
    _inboxes[source] = inbox
    _threads[source] = Thread(
        target=_run, args=(listen, ref(inbox)), name=f"stream {source}", daemon=True
    )
    _threads[source].start()
    return inbox


def _run(listen: Listen, inbox: "ref[Inbox]") -> None:
    """Listen; who reads the inbox is told if that fails, whatever is raised."""
    try:
        listen(inbox)
    except BaseException as error:
        if (there := inbox()) is not None:
            there.fail(error)


def kind_of(source: str) -> AddressKind:
    """Return what understands an address."""
    kinds = entry_points("targets")
    if found := kinds.get(source.partition("://")[0]):
        kind: AddressKind = found.load()
        return kind
    schemes = " or ".join(f"{name}://" for name in sorted(kinds)) or "none"
    raise StreamError(
        f"source is {source!r}; an address begins with {schemes}, and the path of a "
        "recording contains no '://'"
    )


LARGEST_FILE = 100_000_000  # size of the largest recording that is read [bytes]


class Recording:
    """Recorded messages as a source; the same run takes them at the same times."""

    def __init__(
        self, entries: Iterable[tuple[float, Message]], record: InboxRecord
    ) -> None:
        """Begin at the first message, and record what is taken."""
        self._entries, self._record = list(entries), record
        self._next = 0

    def take(self, t: float) -> list[tuple[float, Message]]:
        """Return what was recorded up to a time and was not taken, and when [s]."""
        begin = self._next
        while self._next < len(self._entries) and self._entries[self._next][0] <= t:
            self._next += 1
        found = self._entries[begin : self._next]
        for at, message in found:
            self._record.add(at, (message,))
        return found

    def copy(self) -> "Recording":
        """Return a source that goes on from here, with a record of its own."""
        other = Recording(self._entries, InboxRecord())
        other._next = self._next
        return other


def recorded(
    data: Sequence[Mapping[str, Any]], space: Space
) -> list[tuple[float, Message]]:
    """Return the messages of a recording, and when they were taken [s]."""
    entries: list[tuple[float, Message]] = []
    for k, each in enumerate(data):
        try:
            if not isinstance(each, Mapping) or not _is_number(each.get("at")):
                raise StreamError("it needs the time at which it is taken: at [s]")
            at = float(each["at"])
            if entries and at < entries[-1][0]:
                raise StreamError(f"at is {at:g}, earlier than {entries[-1][0]:g}")
            rest = {key: value for key, value in each.items() if key != "at"}
            entries.append((at, message_of(rest, space)))
        except StreamError as error:
            raise StreamError(f"message {k} of the recording: {error}") from None
    return entries


def read_recording(path: Path) -> list[dict[str, Any]]:
    """Return the messages in a file of JSON lines."""
    try:
        if path.exists() and not path.is_file():
            raise StreamError(f"{path}: no file, but a folder, a device or a pipe")
        if (size := path.stat().st_size) > LARGEST_FILE:
            raise StreamError(
                f"{path}: {size} bytes; a recording has at most {LARGEST_FILE}"
            )
        lines = path.read_text(encoding="utf-8").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise StreamError(f"{path}: the recording cannot be read: {error}") from None
    found = []
    for k, line in enumerate(lines):
        if not line.strip():
            continue
        try:
            found.append(parsed(line))
        except (ValueError, RecursionError) as error:
            raise StreamError(f"{path}:{k + 1}: not JSON: {error}") from None
    return found


def _is_number(value: object) -> bool:
    number = isinstance(value, int | float) and not isinstance(value, bool)
    return number and abs(value) < float("inf")  # type: ignore[arg-type]


class Mailbox:
    """The messages of one stream, whichever controller it was placed in."""

    def __init__(self, hears: str, space: Space) -> None:
        """Begin without messages."""
        self._hears = hears
        self.inbox = Inbox(space)
        self.record = InboxRecord()

    def put(self, **data: Any) -> None:
        """Add a message; see `message_of`."""
        if self._hears:
            raise StreamError(
                f"this stream hears {self._hears}; only a stream without source and "
                "messages can be sent to"
            )
        self.inbox.put(**data)

    def reader(self, space: Space, *, kept: bool) -> InboxReader:
        """Return the reader of a new run; a source is opened here."""
        if is_address(self._hears):
            self.inbox = listening_inbox(self._hears, space)
        elif self.inbox.space.linear not in (None, space.linear):
            raise StreamError(
                f"this stream already carries {self.inbox.space.width} numbers; here "
                f"{space.width} are needed"
            )
        self.inbox.space = space
        if not kept:
            return InboxReader(self.inbox, InboxRecord()).copy()
        self.record = InboxRecord()
        return InboxReader(self.inbox, self.record)

    def recording(
        self, entries: list[tuple[float, Message]], *, kept: bool
    ) -> Recording:
        """Return recorded messages, see `recorded`, as the source of a new run."""
        if not kept:
            return Recording(entries, InboxRecord())
        self.record = InboxRecord()
        return Recording(entries, self.record)
