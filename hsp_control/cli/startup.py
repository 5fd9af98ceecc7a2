"""Ctrl-C during imports.

Imports take a second. If this process is ``hsp``, Ctrl-C during imports ends it with
one line and no traceback. The same holds later, while a command has nothing to save. A
program that only imports the package is not affected.
"""

import os
import signal
import sys
import threading
from itertools import pairwise
from pathlib import Path
from types import FrameType

INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it: 128 and the number of SIGINT."""


def is_command() -> bool:
    """Return whether this process is ``hsp`` or ``python -m hsp_control``."""
    if Path(sys.argv[0]).name in ("hsp", "hsp.exe"):
        return True
    return ("-m", "hsp_control") in pairwise(sys.orig_argv)


def end_quietly(_: int, __: FrameType | None) -> None:
    """End the process with the message and exit status of a stopped run."""
    os.write(2, b"hsp: stopped by the user\n")
    os._exit(INTERRUPTED)


def guard_imports() -> None:
    """Let Ctrl-C end the process at once, if the process is ``hsp``."""
    unchanged = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    in_main_thread = threading.current_thread() is threading.main_thread()
    if unchanged and is_command() and in_main_thread:
        signal.signal(signal.SIGINT, end_quietly)


guard_imports()  # the package imports this module first
