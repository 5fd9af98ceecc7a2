"""What a run has taken from a stream, and when: for the log, so that it repeats."""

from collections.abc import Iterable
from typing import Any

from hsp_control.trajectories.streams.message import Message

MOST = 5_000_000
"""Most numbers that are recorded: poses at 60 Hz for three hours, 0.1 GB."""


class Record:
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
