"""Requests of an operator, or of another thread, to a running loop."""

from collections import deque
from collections.abc import Callable


class OperatorRequests:
    """A stop request, and changes to make between two periods; safe from any thread.

    Attributes:
        reason: Why the operator requested a stop; None without a request.
    """

    def __init__(self) -> None:
        self.reason: str | None = None
        self._changes: deque[Callable[[], object]] = deque()

    def stop(self, reason: str = "the operator's stop") -> None:
        """Request a safe stop; the first reason is kept."""
        if self.reason is None:
            self.reason = reason

    def call(self, change: Callable[[], object]) -> None:
        """Request that a change is made between two periods, for example a new task.

        ``requests.call(lambda: controller.at(t).gains(...))``. If it raises, the
        robot is stopped. The loop waits until it returns: a change of the controller
        takes a few milliseconds. With a type of task or field that was never used it
        takes longer, because kernels are compiled: compute once with it before.
        """
        self._changes.append(change)

    def run_pending(self) -> None:
        """Make the requested changes, oldest first."""
        while self._changes:
            self._changes.popleft()()
