"""Ctrl-C before there is anything to interrupt.

Python takes its time to import what the command line needs. Where this process is
``hsp``, Ctrl-C ends it meanwhile with the one line that it gets later, too, not with a
traceback through other people's imports; and so it does later, while a command has
nothing to save. A program that imports the package is left
alone.
"""

import os
import signal
import sys
import threading
from itertools import pairwise
from pathlib import Path
from types import FrameType


def is_command() -> bool:
    """Say whether this process was started as ``hsp`` or ``python -m hsp_control``."""
    if Path(sys.argv[0]).name in ("hsp", "hsp.exe"):
        return True
    words = sys.orig_argv
    return ("-m", "hsp_control") in pairwise(words)


def end_quietly(_: int, __: FrameType | None) -> None:
    """End the process with the message and the status of a run that was stopped."""
    os.write(2, b"hsp: stopped by the user\n")
    os._exit(2)


def guard_imports() -> None:
    """Let Ctrl-C end the process at once, if it is ``hsp`` and nobody else's."""
    ours = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    if ours and is_command() and threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, end_quietly)


guard_imports()  # the package imports this module first
