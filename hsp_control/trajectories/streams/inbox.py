"""The messages that wait, who sends them, and those that were taken."""

import logging
import re
from collections import deque
from collections.abc import Iterable, Mapping
from math import inf
from threading import Lock
from typing import Any, NamedTuple

from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.message import NO_TOOL, Message, Space, message_of

_log = logging.getLogger(__name__)
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
_SILENCE = 2.0  # who sent several messages is heard alone until so long a silence [s]
_JUMP = 1.0  # what a clock goes back, or ahead of ours, that is no delay [s]
_MOST_SAID = 16  # different things that are said of one source
_NUMBER = re.compile(r"-?\d[\d.:e+-]*|\bnan\b|-?\binf\b")


class Received(NamedTuple):
    """A message and its number; numbers increase by one."""

    number: int  # the number of the message
    message: Message


class Inbox:
    """Messages of one source; each reader remembers the number of its last message."""

    def __init__(self, space: Space, source: str = "") -> None:
        """Set what a value is, and the address that is heard; by default none is."""
        self.space, self._source = space, source
        self.count = self.rejected = self.taken = 0
        self.reason = ""
        self.failure = ""  # why nobody listens any more
        self._waiting: deque[Received] = deque(maxlen=CAPACITY)
        self._lock = Lock()
        self._said: set[str] = set()
        self._sender, self._until = "", -inf  # who is heard alone, and until when
        self._seen: dict[str, float] = {}
        self._newest, self._behind = -inf, inf  # of its clock: its time, ours after it

    @property
    def source(self) -> str:
        """The address that is heard; empty without one."""
        return self._source

    def check_sender(self, sender: str, now: float) -> None:
        """Raise if another one sends, who was first; ``now`` is our own time [s]."""
        if sender != self._sender and now < self._until:
            raise StreamError(
                f"{sender} sends while {self._sender} does, which was first and is "
                f"heard alone until it is silent for {_SILENCE:g} s"
            )

    def receive(self, sender: str, now: float, data: Mapping[str, Any]) -> None:
        """Add a message of somebody elsewhere; say once what is odd about its clock."""
        self.check_sender(sender, now)
        self.put(**data)
        if sender != self._sender:
            self._sender, self._newest, self._behind = sender, -inf, inf
        seen = {name: at for name, at in self._seen.items() if now - at < _SILENCE}
        self._until = now + _SILENCE if sender in seen else -inf  # one is no stream
        self._seen = {**seen, sender: now}
        if (t := data.get("t")) is None:
            return
        back, ahead = self._newest - t, self._behind - (now - t)
        if back > _JUMP:
            self._say(f"the sender's clock jumps back by {back:.3g} s")
        elif _JUMP < ahead < inf:
            self._say(f"the sender's clock jumps ahead by {ahead:.3g} s")
        if max(back, ahead) > _JUMP:  # it counts as another clock
            self._newest, self._behind = -inf, inf
        self._newest, self._behind = max(self._newest, t), min(self._behind, now - t)

    def note_silence(self, now: float) -> None:
        """Say once that who sent several messages sends no more."""
        if -inf < self._until <= now:
            self._until = -inf
            self._say(
                f"{self._sender} is silent for {_SILENCE:g} s; the reference rests "
                "where its last message ends"
            )

    def put(self, **data: Any) -> None:
        """Add a message, given by its entries; see `message_of`."""
        message = message_of(data, self.space)
        with self._lock:
            self.count += 1
            self._waiting.append(Received(self.count, message))

    def fail(self, error: BaseException) -> None:
        """Let each reader raise: the thread that listens has ended with an error."""
        try:
            text = str(error)
        except Exception:  # of somebody's own type
            text = ""
        name = type(error).__name__
        self.failure = f"{name}: {text}" if text else name

    def reject(self, reason: str, *, aloud: bool = True) -> None:
        """Count an invalid message; each kind of reason is said once."""
        with self._lock:
            self.rejected += 1
            self.reason = reason
        if self._source and aloud:
            self._say(f"a message is dropped: {reason}")

    def _say(self, what: str) -> None:
        """Warn, once for all that differs in its numbers alone."""
        kind = _NUMBER.sub("", what)
        if kind not in self._said and len(self._said) < _MOST_SAID:
            self._said.add(kind)
            _log.warning("%s: %s", self._source, what)

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
        """Return what is there at a time [s] and was not taken, and this time.

        Raises:
            StreamError: If nobody listens any more.
        """
        if self._inbox.failure:
            raise StreamError(
                f"{self._inbox.source}: its thread has ended: {self._inbox.failure}"
            )
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
        if message.axes == "tool" and not space.rotational:
            self._inbox.reject(NO_TOOL)
            return False
        return True
