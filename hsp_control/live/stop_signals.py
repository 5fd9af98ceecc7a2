"""Signals as an operator's stop: Ctrl-C, and what ends a process."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from hsp_control.live.operator_requests import OperatorRequests

_KINDS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_DEFAULTS = (signal.SIG_DFL, signal.default_int_handler)


@contextmanager
def stop_signals(
    requests: OperatorRequests, *, takes_over: bool = False
) -> Iterator[None]:
    """Make Ctrl-C and termination signals request the operator's stop.

    The first signal only sets the request, so that it interrupts nothing: no row of the
    log, no message to the robot. A second one raises `KeyboardInterrupt`: the loop ends
    at once, and the robot's watchdog stops the robot. Signals that the program handles
    itself, or ignores, are left to it unless ``takes_over``. Outside the main thread,
    which alone receives signals, the context does nothing.
    """

    def stop(number: int, frame: object) -> None:
        requests.stop(f"stopped by the operator ({signal.Signals(number).name})")
        for kind in before:
            signal.signal(kind, signal.default_int_handler)

    before = {
        kind: handler
        for kind in _KINDS
        if threading.current_thread() is threading.main_thread()
        and (handler := signal.getsignal(kind)) is not None
        and (takes_over or handler in _DEFAULTS)
    }
    for kind in before:
        signal.signal(kind, stop)
    try:
        yield
    finally:
        for kind, handler in before.items():
            signal.signal(kind, handler)
