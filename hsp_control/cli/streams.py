"""Standard streams made safe to write to: closed ones, in ASCII, or full."""

import errno
import os
import sys
from collections.abc import Callable
from contextlib import suppress
from typing import Any

_WRITTEN = "·µ°≤→"
"""Characters of our output; a question mark replaces those without an encoding."""


class LastingStream:
    """A standard stream while its text is read; later text is discarded.

    A pipe may lose its reader (``hsp live ... | head``), a disk may be full: that must
    not end a run, and lose its log.

    Attributes:
        failure: Why text was lost; None if none was, or its reader has gone.
    """

    def __init__(self, stream: Any, number: int) -> None:
        """Store the stream, and the number of its file."""
        self._stream, self._number = stream, number
        self.failure: str | None = None

    def write(self, text: str) -> int:
        """Write a text."""
        self._try(lambda: self._stream.write(text))
        return len(text)

    def flush(self) -> None:
        """Write the buffered text."""
        self._try(self._stream.flush)

    def _try(self, function: Callable[[], object]) -> None:
        try:
            function()
        except OSError as error:
            if error.errno != errno.EPIPE:
                self.failure = error.strerror
            nothing = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nothing, self._number)
            os.close(nothing)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


def lost_text() -> str | None:
    """Return why standard output has lost text; None if it has not."""
    sys.stdout.flush()
    return getattr(sys.stdout, "failure", None)


def make_usable() -> None:
    """Redirect closed streams to nothing, and let others accept any text.

    Otherwise a newly opened file would have the number of a closed stream, and would
    receive the output of libraries.
    """
    for number, mode in ((0, os.O_RDONLY), (1, os.O_WRONLY), (2, os.O_WRONLY)):
        try:
            os.fstat(number)
        except OSError:
            opened = os.open(os.devnull, mode)
            if opened != number:
                os.dup2(opened, number)
                os.close(opened)
    for name, number in (("stdin", 0), ("stdout", 1), ("stderr", 2)):
        stream = getattr(sys, name)
        if stream is None:
            kind = "w" if number else "r"
            file = open(number, kind, encoding="utf-8", closefd=False)  # noqa: SIM115
            setattr(sys, name, file)
        elif number and hasattr(stream, "reconfigure"):
            # A file's name may have characters that no encoding has: as escapes.
            lost = "backslashreplace"
            try:
                _WRITTEN.encode(stream.encoding or "ascii")
            except (UnicodeEncodeError, LookupError):
                lost = "replace"
            with suppress(OSError, ValueError):
                stream.reconfigure(errors=lost)
        if number and _is_standard(getattr(sys, name), number):
            setattr(sys, name, LastingStream(getattr(sys, name), number))


def _is_standard(stream: Any, number: int) -> bool:
    """Return whether a stream is the process's own, and not yet a lasting one."""
    try:
        own = stream.fileno() == number
    except (OSError, ValueError, AttributeError):
        return False
    return own and not isinstance(stream, LastingStream)
