"""The lock of a controller: other threads wait, and the thread that has it is told."""

import sys
from collections.abc import Collection
from threading import Lock
from types import CodeType, FrameType

from hsp_control.common.exceptions import ControllerError


class StepLock:
    """A lock that does not let a thread wait for itself.

    Whether it is the same thread is looked for when the lock is taken, among the
    functions that this thread runs: a step that gets it at once pays nothing for it.
    """

    def __init__(self, holders: Collection[CodeType]) -> None:
        """Set which methods hold it."""
        lock = Lock()
        self.acquire, self.release = lock.acquire, lock.release
        # code of the methods that hold the lock of their ``self._lock``
        self.holders = holders

    def wait(self) -> None:
        """Take the lock after another thread."""
        frame: FrameType | None = sys._getframe(1)
        if frame is not None and frame.f_code is _ENTER:
            frame = frame.f_back
        frame = frame and frame.f_back  # not the caller, which has not got it yet
        while frame is not None:
            if (
                frame.f_code in self.holders
                and frame.f_locals["self"]._lock is self  # not another controller
            ):
                raise ControllerError(
                    "a step of a controller calls the same controller, for example "
                    "within a field: it would wait for itself for ever; use the state "
                    "that the field is given, or a copy, controller.preview()"
                )
            frame = frame.f_back
        self.acquire()

    def __enter__(self) -> None:
        if not self.acquire(False):
            self.wait()

    def __exit__(self, *_: object) -> None:
        self.release()


_ENTER = StepLock.__enter__.__code__
