"""What the copies of one stream share: where messages arrive, and what was taken."""

from typing import Any

from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.inbox import Inbox, InboxReader
from hsp_control.trajectories.streams.listeners import is_address, listening_inbox
from hsp_control.trajectories.streams.message import Message, Space
from hsp_control.trajectories.streams.record import Record
from hsp_control.trajectories.streams.recording import Recording


class Mailbox:
    """The messages of one stream, whichever controller it was placed in."""

    def __init__(self, hears: str, space: Space) -> None:
        """Begin without messages."""
        self._hears = hears
        self.inbox = Inbox(space)
        self.record = Record()

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
            return InboxReader(self.inbox, Record()).copy()
        self.record = Record()
        return InboxReader(self.inbox, self.record)

    def recording(
        self, entries: list[tuple[float, Message]], *, kept: bool
    ) -> Recording:
        """Return recorded messages, see `recorded`, as the source of a new run."""
        if not kept:
            return Recording(entries, Record())
        self.record = Record()
        return Recording(entries, self.record)
