"""Ctrl-C during a run: the first one asks it to end, the second one insists.

A `KeyboardInterrupt` may be raised anywhere, also between the last row and the log's
file, and everything computed would be gone. So the first Ctrl-C only leaves word, which
the run finds at its next row; nothing is lost, wherever it comes.
"""

import signal
import threading
from types import FrameType
from typing import Any, Self


class FirstInterruptWaits:
    """Within this block the first Ctrl-C is kept for `check`; a second one interrupts.

    Outside the main thread, which alone gets signals, it does nothing, nor where
    whoever started the process has it ignore them.
    """

    def __init__(self) -> None:
        """Nothing has come."""
        self.asked = False
        self._before: Any = None

    def check(self) -> None:
        """Raise the interrupt that has come, if one has.

        Raises:
            KeyboardInterrupt: The first time that it is asked after a Ctrl-C.
        """
        if self.asked:
            self.asked = False
            raise KeyboardInterrupt

    def __enter__(self) -> Self:
        ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        if not ignored and threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._keep)
        return self

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def _keep(self, _: int, __: FrameType | None) -> None:
        self.asked = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
