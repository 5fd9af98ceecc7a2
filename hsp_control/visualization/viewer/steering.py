"""Which page steers the program, and what it has sent: the way from page to parent.

The server's process imports this module: it needs only the standard library.
"""

import json
import select
from collections.abc import Callable
from typing import Any

LONGEST = 4000
"""Most bytes of a message of a page: a pipe that is ready takes that many at once."""


class Steering:
    """One page steers; a message replaces a waiting one of its kind and object."""

    def __init__(self, parent: int) -> None:
        """Begin without a page."""
        self.page: object | None = None
        self._parent = parent
        self._waiting: dict[tuple[str, str], str] = {}

    def enter(self, page: object) -> bool:
        """Let a page that was opened steer, if no other one does; return whether."""
        if self.page is None:
            self.page = page
        return self.page is page

    def leave(self, page: object) -> bool:
        """Return whether the page that was closed has steered; the parent is told."""
        if self.page is not page:
            return False
        self.page = None
        self._put({"do": "left"})
        return True

    def take(self, page: object, text: str) -> bool:
        """Take a page's message; return whether the page steers only from now on."""
        if len(text.encode()) > LONGEST:
            raise ValueError("the message is too long")
        message = json.loads(text, parse_constant=_refuse)
        if not isinstance(message, dict) or not isinstance(message.get("do"), str):
            raise ValueError("a message is an object with a text `do`")
        if message["do"] == "take_over":
            taken = self.page is not page
            if taken:
                self.page = page
                self._put({"do": "left"})  # what the other page held is let go
            return taken
        if self.page is page:
            self._put(message)
        return False

    def flush(self) -> bool:
        """Pass on what the parent can take now; return whether nothing waits."""
        poll = select.poll()
        poll.register(self._parent, select.POLLOUT)
        while self._waiting and poll.poll(0):
            key = next(iter(self._waiting))
            self._write(self._waiting.pop(key))
        return not self._waiting

    def _put(self, message: dict[str, Any]) -> None:
        parts = [message.get(name, "") for name in ("target", "name", "id")]
        key = message["do"], json.dumps(parts)
        self._waiting.pop(key, None)  # the newest comes last
        self._waiting[key] = json.dumps({"message": message})

    def _write(self, line: str) -> None:
        with open(self._parent, "w", closefd=False) as pipe:
            pipe.write(line + "\n")


def _refuse(word: str) -> Callable[[], None]:
    raise ValueError(f"{word} is no number")
