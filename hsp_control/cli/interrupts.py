"""Ctrl-C during a run: the first one asks it to end, the second one insists.

A `KeyboardInterrupt` may be raised anywhere, also between the last row and the log's
file, and everything computed would be gone. So the first Ctrl-C only leaves word, which
the run finds at its next row; nothing is lost, wherever it comes. Where no row comes,
as an integrator may fall to steps of a nanosecond, it interrupts what is computed then.
"""

import _thread
import signal
import threading
from types import FrameType
from typing import Any, Self

PATIENCE = 1.0
"""How long the first Ctrl-C waits for a row [s]."""


class FirstInterruptWaits:
    """Within this block the first Ctrl-C is kept for `check`; a second one interrupts.

    So does the first itself, if nothing has checked in a second, until `settle`.

    Outside the main thread, which alone gets signals, it does nothing, nor where
    whoever started the process has it ignore them.
    """

    def __init__(self) -> None:
        """Nothing has come."""
        self.asked = False
        self._before: Any = None
        self._settled = False
        self._patience = threading.Timer(PATIENCE, _thread.interrupt_main)
        self._patience.daemon = True

    def check(self) -> None:
        """Raise the interrupt that has come, if one has.

        Raises:
            KeyboardInterrupt: The first time that it is asked after a Ctrl-C.
        """
        if self.asked:
            self.asked = False
            self._patience.cancel()
            raise KeyboardInterrupt

    def settle(self) -> None:
        """From here on only a second Ctrl-C interrupts: what there is is to be kept."""
        self._settled = True
        self._patience.cancel()

    def __enter__(self) -> Self:
        ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN
        if not ignored and threading.current_thread() is threading.main_thread():
            self._before = signal.signal(signal.SIGINT, self._keep)
        return self

    def __exit__(self, *_: object) -> None:
        self.settle()
        if self._before is not None:
            signal.signal(signal.SIGINT, self._before)

    def _keep(self, _: int, __: FrameType | None) -> None:
        self.asked = True
        signal.signal(signal.SIGINT, signal.default_int_handler)
        if not self._settled:
            self._patience.start()
