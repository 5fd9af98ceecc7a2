"""Ctrl-C during a run: the first one ends the run at its next row, the second at once.

A `KeyboardInterrupt` may be raised anywhere, also between the last row and writing the
log; all computed rows would then be lost. So the first Ctrl-C only sets a flag, which
the run checks at its next row. If no row comes (an integrator may reduce its steps to a
nanosecond), the computation is interrupted after a short time.
"""

import _thread
import signal
import threading
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
        """Create the context; entering it installs the signal handler."""
        self.requested = False  # whether a Ctrl-C has come that `check` has not raised
        self._before: Any = None
        self._first_ignored = False
        self._patience = threading.Timer(PATIENCE, _thread.interrupt_main)
        self._patience.daemon = True

    def check(self) -> None:
        """Raise `KeyboardInterrupt` if Ctrl-C has come."""
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
