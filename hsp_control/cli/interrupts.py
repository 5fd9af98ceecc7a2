"""Ctrl-C: during imports, and during a run.

Imports take a second. If this process is ``hsp``, Ctrl-C during imports ends it with
one line and no traceback. The same holds later, while a command has nothing to save. A
program that only imports the package is not affected.

During a run the first Ctrl-C ends the run at its next row, the second at once. A
`KeyboardInterrupt` may be raised anywhere, also between the last row and writing the
log; all computed rows would then be lost. So the first Ctrl-C only sets a flag, which
the run checks at its next row. Without a row (an integrator may reduce its steps to a
nanosecond), the computation is interrupted after a short time.
"""

import _thread
import os
import signal
import sys
import threading
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import Any, Self

PATIENCE = 1.0
"""Time for which the first Ctrl-C waits for a row [s]."""


class DeferredInterrupt:
    """A context in which `check` raises the first Ctrl-C; a second one acts at once.

    If `check` is not called within `PATIENCE`, the first Ctrl-C acts then, except after
    `ignore_first`. The context does nothing outside the main thread, which
    alone receives signals, and in a process that ignores Ctrl-C.
    """

    def __init__(self) -> None:
        self.requested = False  # whether there was a Ctrl-C that `check` has not raised
        self._before: Any = None
        self._first_ignored = False
        self._patience = threading.Timer(PATIENCE, _thread.interrupt_main)
        self._patience.daemon = True

    def check(self) -> None:
        """Raise `KeyboardInterrupt` after Ctrl-C."""
        if self.requested:
            self.requested = False
            self._patience.cancel()
            raise KeyboardInterrupt

    def ignore_first(self) -> None:
        """From now on only a second Ctrl-C interrupts, so that the log can be saved."""
        self._first_ignored = True
        self._patience.cancel()

    def __enter__(self) -> Self:
        ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        if not ignored and threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._defer)
        return self

    def __exit__(self, *_: object) -> None:
        self.ignore_first()
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def _defer(self, _: int, __: FrameType | None) -> None:
        self.requested = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if not self._first_ignored:
            self._patience.start()


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


def end_in_order() -> None:
    """From now on Ctrl-C raises `KeyboardInterrupt`: files must be closed."""
    if signal.getsignal(signal.SIGINT) is end_quietly:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def guard_imports() -> None:
    """Let Ctrl-C end the process at once, if the process is ``hsp``."""
    unchanged = signal.getsignal(signal.SIGINT) is signal.default_int_handler
    in_main_thread = threading.current_thread() is threading.main_thread()
    if unchanged and is_command() and in_main_thread:
        signal.signal(signal.SIGINT, end_quietly)


guard_imports()  # the package imports this module first
