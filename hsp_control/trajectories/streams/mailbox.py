"""What the copies of one stream share: where messages arrive, and what was taken."""

from typing import Any

from hsp_control.common.exceptions import StreamError
from hsp_control.trajectories.streams.inbox import Inbox, InboxReader
from hsp_control.trajectories.streams.listeners import is_address, listening_inbox
from hsp_control.trajectories.streams.message import Message, Space
from hsp_control.trajectories.streams.record import Record
from hsp_control.trajectories.streams.recording import Recording


class Mailbox:
    """The messages of one stream, whichever controller it was placed in.

    Attributes:
        record: What the last run has taken, and when.
        inbox: The messages that wait.
    """

    def __init__(self, hears: str, space: Space) -> None:
        """Begin without messages.

        Args:
            hears: The source, if there is one besides `put`.
            space: What a value is, as far as it is known.
        """
        self._hears = hears
        self.inbox = Inbox(space)
        self.record = Record()

    def put(self, **data: Any) -> None:
        """Add a message; see `message_of`.

        Raises:
            StreamError: If it is not valid, or the stream has another source.
        """
        if self._hears:
            raise StreamError(
                f"this stream hears {self._hears}; only a stream without source and "
                "messages can be sent to"
            )
        self.inbox.put(**data)

    def reader(self, space: Space, *, kept: bool) -> InboxReader:
        """Return the reader of a new run; a source is opened here.

        Args:
            space: What a value is.
            kept: Whether what it takes is recorded, and not taken again by later runs;
                otherwise it is a preview.

        Raises:
            StreamError: If the source cannot be opened, or carries other values.
        """
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
