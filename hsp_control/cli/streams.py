"""Standard streams that a command can write to: closed ones, and those in ASCII."""

import os
import sys
from contextlib import suppress

_WRITTEN = "·µ°≤→"
"""Characters of our output; where one has no place, a question mark stands for it."""


def make_usable() -> None:
    """Let closed streams lead nowhere, and others take any text.

    A file that is opened would else get the number of a closed stream, and what
    libraries print would stand in it.
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
            try:
                _WRITTEN.encode(stream.encoding or "ascii")
            except (UnicodeEncodeError, LookupError):
                with suppress(OSError, ValueError):
                    stream.reconfigure(errors="replace")
