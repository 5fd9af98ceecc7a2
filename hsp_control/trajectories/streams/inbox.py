"""A queue of messages, sent or recorded ones, and its readers."""

import logging
import re
from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from itertools import starmap
from math import inf
from threading import Lock
from typing import Any, NamedTuple, Self

from hsp_control.common.errors import StreamError
from hsp_control.trajectories.streams.message import Message, Space, message_of

_log = logging.getLogger(__name__)
MOST = 5_000_000
"""Maximum count of numbers in a log: poses at 60 Hz for three hours, 0.1 GB."""
BRIEF = 20_000
"""Maximum count of numbers recorded without a log."""
CAPACITY = 4096  # maximum number of queued messages; beyond it the oldest are dropped
_SILENCE = 2.0  # time for which a sender of several messages stays the only one [s]
_JUMP = 1.0  # jump of a clock, back or ahead of ours, that is not a delay [s]
_MOST_SAID = 16  # maximum number of different warnings about one source
_NUMBER = re.compile(r"-?\d[\d.:e+-]*|\bnan\b|-?\binf\b")


class Received(NamedTuple):
    """A message and its number; numbers increase by one."""

    number: int  # the number of the message
    message: Message


class Inbox:
    """A queue of messages; readers remember the number of their last one.

    Messages of `send`, of a listening thread or of a topic of ROS 2 are available at
    once, and the oldest are dropped if many are queued. A recording is available from
    the start, each message with its time.
    """

    def __init__(self, space: Space, source: str = "") -> None:
        """Set the kind of values, and the address to listen to; by default none."""
        self.space, self._source = space, source
        self.count = self.rejected = self.taken = 0
        self.reason = ""
        self.failure = ""  # why the listener has ended
        self._waiting: deque[Received] = deque(maxlen=CAPACITY)
        self._lock = Lock()
        self._said: set[str] = set()
        self._sender, self._until = "", -inf  # the only accepted sender, and until when
        self._seen: dict[str, float] = {}
        self._newest, self._behind = -inf, inf  # of its clock: its time, ours after it

    @classmethod
    def recorded(cls, space: Space, messages: Iterable[Message]) -> Self:
        """Return a queue of recorded messages, in order of the times ``at``."""
        inbox = cls(space)
        inbox._waiting = deque(starmap(Received, enumerate(messages, 1)))
        inbox.count = len(inbox._waiting)
        return inbox

    @property
    def source(self) -> str:
        """The address that it listens to; empty without one."""
        return self._source

    def check_sender(self, sender: str, now: float) -> None:
        """Raise if another sender was first; ``now`` is our own time [s]."""
        if sender != self._sender and now < self._until:
            raise StreamError(
                f"{sender} is ignored: {self._sender} sent first, and is the only "
                f"sender accepted until it has been silent for {_SILENCE:g} s"
            )

    def receive(self, sender: str, now: float, data: Mapping[str, Any]) -> None:
        """Add a message of another process; warn once if its clock is odd."""
        self.check_sender(sender, now)
        self.put(**data)
        if sender != self._sender:
            self._sender, self._newest, self._behind = sender, -inf, inf
        seen = {name: at for name, at in self._seen.items() if now - at < _SILENCE}
        self._until = (
            now + _SILENCE if sender in seen else -inf
        )  # a single message is not a stream
        self._seen = {**seen, sender: now}
        if (t := data.get("t")) is None:
            return
        back, ahead = self._newest - t, self._behind - (now - t)
        if back > _JUMP:
            self._say(f"the sender's clock jumps back by {back:.3g} s")
        elif _JUMP < ahead < inf:
            self._say(f"the sender's clock jumps ahead by {ahead:.3g} s")
        if max(back, ahead) > _JUMP:  # it is treated as another clock
            self._newest, self._behind = -inf, inf
        self._newest, self._behind = max(self._newest, t), min(self._behind, now - t)

    def note_silence(self, now: float) -> None:
        """Warn once that the only sender has fallen silent."""
        if -inf < self._until <= now:
            self._until = -inf
            self._say(
                f"{self._sender} has been silent for {_SILENCE:g} s; the reference "
                "rests where its last message ends"
            )

    def put(self, **data: Any) -> None:
        """Add a message, given by its entries; see `message_of`."""
        message = message_of(data, self.space)
        with self._lock:
            self.count += 1
            self._waiting.append(Received(self.count, message))

    def fail(self, error: BaseException) -> None:
        """Make all readers raise: the listening thread has ended with an error."""
        try:
            text = str(error)
        except BaseException:  # of a user's own type
            text = ""
        name = type(error).__name__
        self.failure = f"{name}: {text}" if text else name

    def reject(self, reason: str, *, aloud: bool = True) -> None:
        """Count an invalid message; kinds of reasons are logged once."""
        with self._lock:
            self.rejected += 1
            self.reason = reason
        if self._source and aloud:
            self._say(f"a message is dropped: {reason}")

    def _say(self, what: str) -> None:
        """Warn, once for messages that differ only in their numbers."""
        kind = _NUMBER.sub("", what)
        if kind not in self._said and len(self._said) < _MOST_SAID:
            self._said.add(kind)
            _log.warning("%s: %s", self._source, what)

    def after(self, number: int, *, take: bool, until: float = inf) -> list[Received]:
        """Return the queued messages after a number, in order of arrival.

        Args:
            number: The number of the last known one.
            take: Whether later readers no longer receive them.
            until: Only those whose time has come [s].
        """
        found, bounded = [], until < inf
        with self._lock:
            waiting = self._waiting
            known = number - self.count + len(waiting)  # dropped ones have no number
            for k in range(max(known, 0), len(waiting)):
                if bounded and waiting[k].message.at > until:
                    break
                found.append(waiting[k])
            if take and found:
                self.taken = found[-1].number
        return found

    def __getstate__(self) -> dict[str, Any]:
        """Return the untaken messages; a copy elsewhere receives those sent there."""
        taken, bounded = self.taken, self._waiting.maxlen is not None
        waiting = self.after(taken if bounded else 0, take=False)
        return {
            "space": self.space,
            "count": waiting[-1].number if waiting else taken,  # another may arrive now
            "taken": taken,
            "waiting": waiting,
            "bounded": bounded,
        }

    def __setstate__(self, saved: dict[str, Any]) -> None:
        """Begin with the queued messages."""
        self.__init__(saved["space"])  # type: ignore[misc]
        self.count, self.taken = saved["count"], saved["taken"]
        most = CAPACITY if saved["bounded"] else None
        self._waiting = deque(saved["waiting"], maxlen=most)


class Taken(NamedTuple):
    """A message in a record."""

    message: Message
    t: float  # time of the step that read it [s]


class Reader:
    """Reads messages for one run, and records them; it begins with the unread ones.

    Attributes:
        inbox: The queue.
        record: The messages that were taken.
        lost: The number of messages that were not recorded.
    """

    def __init__(self, inbox: Inbox, *, aside: bool = False) -> None:
        """Begin to read; ``aside``: taken messages stay available for other readers."""
        self.inbox, self._aside = inbox, aside
        self._number = inbox.taken
        self._missed: list[Received] = []
        self.record: list[Taken] = []
        self.lost = self._recorded = 0
        self.logged = False  # whether a log needs the whole record

    def take(self, t: float) -> Sequence[Message]:
        """Return the untaken messages at a time [s].

        Raises:
            StreamError: If the listener has ended.
        """
        inbox = self.inbox
        if inbox.failure:
            raise StreamError(f"{inbox.source}: its thread has ended: {inbox.failure}")
        if inbox.count == self._number and not self._missed:
            return ()
        received = inbox.after(self._number, take=not self._aside, until=t)
        if self._missed:
            received, self._missed = self._missed + received, []
        if received:
            self._number = received[-1].number
        taken = [each.message for each in received]
        for each in taken:
            self._add(each, t)
        return taken

    def copy(self) -> "Reader":
        """Return a reader that continues from here, with its own record."""
        other = Reader(self.inbox, aside=True)
        other._number, other._missed = self._number, self._missed.copy()
        return other

    def _add(self, message: Message, t: float) -> None:
        """Record a message that is read at a time [s], if memory is left."""
        most = MOST if self.logged else min(BRIEF, MOST)
        if self._recorded + message.size <= most:
            self.record.append(Taken(message, t))
            self._recorded += message.size
        else:
            self.lost += 1

    def __getstate__(self) -> dict[str, Any]:
        """Return its queue and the messages that wait for it alone, not the record."""
        inbox, number = self.inbox, self._number
        waiting = inbox.after(number, take=False) if number < inbox.taken else []
        missed = self._missed + [each for each in waiting if each.number <= inbox.taken]
        return {
            "inbox": inbox,
            "aside": self._aside,
            "number": max(number, inbox.taken) if missed else number,
            "missed": missed,
            "lost": self.lost + len(self.record),
        }

    def __setstate__(self, saved: dict[str, Any]) -> None:
        """Continue, with a record without earlier messages."""
        self.__init__(saved["inbox"], aside=saved["aside"])  # type: ignore[misc]
        self._number, self._missed = saved["number"], saved["missed"]
        self.lost = saved["lost"]
