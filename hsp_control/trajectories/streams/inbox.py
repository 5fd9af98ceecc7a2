"""The messages that wait, and those that were taken."""

from collections import deque
from collections.abc import Iterable
from threading import Lock
from typing import Any, NamedTuple

from hsp_control.trajectories.streams.message import Message, Space, message_of

MOST = 5_000_000
"""Most numbers that are recorded: poses at 60 Hz for three hours, 0.1 GB."""


class InboxRecord:
    """Messages and the controller's times at which they were taken."""

    def __init__(self) -> None:
        """Begin without messages."""
        self.lost = self._size = 0
        self._entries: list[tuple[float, Message]] = []

    def add(self, t: float, messages: Iterable[Message]) -> None:
        """Record messages that are taken at a time [s], as long as there is room."""
        for each in messages:
            if self._size + each.size <= MOST:
                self._entries.append((t, each))
                self._size += each.size
            else:
                self.lost += 1

    def to_list(self) -> list[dict[str, Any]]:
        """Return the messages as `recorded` reads them."""
        return [{"at": t, **each.to_dict()} for t, each in self._entries]


CAPACITY = 4096  # most messages that wait; where more come, the oldest are dropped


class Received(NamedTuple):
    """A message and its number; numbers increase by one."""

    number: int  # the number of the message
    message: Message


class Inbox:
    """Messages of one source; each reader remembers the number of its last message."""

    def __init__(self, space: Space) -> None:
        """Set what a value is."""
        self.space = space
        self.count = self.rejected = self.taken = 0
        self.reason = ""
        self._waiting: deque[Received] = deque(maxlen=CAPACITY)
        self._lock = Lock()

    def put(self, **data: Any) -> None:
        """Add a message, given by its entries; see `message_of`."""
        message = message_of(data, self.space)
        with self._lock:
            self.count += 1
            self._waiting.append(Received(self.count, message))

    def reject(self, reason: str) -> None:
        """Count an invalid message."""
        with self._lock:
            self.rejected += 1
            self.reason = reason

    def after(self, number: int, *, take: bool) -> list[Received]:
        """Return the messages that wait, later than a number, in order of arrival."""
        with self._lock:
            if take:
                self.taken = self.count
            return [each for each in self._waiting if each.number > number]

    def __getstate__(self) -> dict[str, Any]:
        """Return no messages: a copy elsewhere hears what is sent there."""
        return {"space": self.space, "count": self.count}

    def __setstate__(self, saved: dict[str, Any]) -> None:
        """Begin without messages."""
        self.__init__(saved["space"])  # type: ignore[misc]
        self.count = self.taken = saved["count"]


class InboxReader:
    """A reader of an inbox in one run; it begins with what nobody took before."""

    def __init__(self, inbox: Inbox, record: InboxRecord) -> None:
        """Begin to read, and to record what is taken."""
        self._inbox, self._record = inbox, record
        self._number = inbox.taken
        self._previews = False

    def take(self, t: float) -> list[tuple[float, Message]]:
        """Return what is there at a time [s] and was not taken, and this time."""
        if self._inbox.count == self._number:
            return []
        received = self._inbox.after(self._number, take=not self._previews)
        if received:
            self._number = received[-1].number
        messages = [each.message for each in received if self._fits(each.message)]
        self._record.add(t, messages)
        return [(t, each) for each in messages]

    def copy(self) -> "InboxReader":
        """Return a reader that goes on from here, with a record of its own."""
        other = InboxReader(self._inbox, InboxRecord())
        other._number, other._previews = self._number, True
        return other

    def _fits(self, message: Message) -> bool:
        """Return whether a message that was sent before the size was known fits."""
        space = self._inbox.space
        for array, width in (
            (message.values, space.width),
            (message.velocities, space.rates),
        ):
            if array is not None and width is not None and array.shape[1] != width:
                self._inbox.reject(
                    f"a message has {array.shape[1]} numbers; this stream needs {width}"
                )
                return False
        return True
