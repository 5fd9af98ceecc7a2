"""What a person, or another thread, may ask of a loop while it runs."""

from collections import deque
from collections.abc import Callable


class Operator:
    """The operator's stop, and changes between two periods; safe from any thread.

    Attributes:
        reason: Why the operator stopped, or None.
    """

    def __init__(self) -> None:
        """Ask for nothing yet."""
        self.reason: str | None = None
        self._changes: deque[Callable[[], object]] = deque()

    def stop(self, reason: str = "the operator's stop") -> None:
        """Have the robot stopped safely; the first reason counts."""
        if self.reason is None:
            self.reason = reason

    def call(self, change: Callable[[], object]) -> None:
        """Have a change made in the rest of a period, such as a task that comes.

        ``operator.call(lambda: controller.change_gains(...))``. What it raises stops
        the robot. Build and try what it needs beforehand: the loop waits for it.
        """
        self._changes.append(change)

    def make_changes(self) -> None:
        """Make the changes that were asked for, oldest first."""
        while self._changes:
            self._changes.popleft()()
