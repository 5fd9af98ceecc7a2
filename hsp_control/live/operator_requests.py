"""Requests of an operator, a signal or another thread to a running loop."""

import signal
import threading
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager


class OperatorRequests:
    """A stop request, and changes to make between two periods; safe from any thread.

    Attributes:
        reason: Why the operator requested a stop; None without a request.
        fault: Whether the request is due to a fault: no operator could stop the loop
        any more.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self.fault = False
        self._changes: deque[Callable[[], object]] = deque()

    def stop(self, reason: str = "the operator's stop", *, fault: bool = False) -> None:
        """Request a safe stop; the first reason is kept."""
        if self.reason is None:
            self.reason, self.fault = reason, fault

    def call(self, change: Callable[[], object]) -> None:
        """Request that a change is made between two periods, for example a new task.

        ``requests.call(lambda: controller.at(t).gains(...))``. If it raises, the
        robot is stopped. The loop waits until it returns: a change of the controller
        takes a few milliseconds. With a type of task or field that was never used it
        takes longer, because calls are bound: compute once with it before.
        """
        self._changes.append(change)

    def run_pending(self) -> None:
        """Make the requested changes, oldest first."""
        while self._changes:
            self._changes.popleft()()


OPERATOR = (KeyboardInterrupt, SystemExit)
"""Exceptions of an operator, or of a program that ends. Anything else that is not an
`Exception`, such as `asyncio.CancelledError` or a panic of an extension, is a fault."""

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
