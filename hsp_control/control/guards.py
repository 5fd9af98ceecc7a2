"""What guards a controller: a lock, and attributes that cannot be assigned."""

import sys
from collections.abc import Callable, Collection
from threading import Lock
from types import CodeType, FrameType
from typing import Any, Generic, NoReturn, Self, TypeVar, overload

from hsp_control.common.exceptions import ControllerError, ImmutableError


class StepLock:
    """A lock: other threads wait for it, and the thread that has it is told.

    Whether it is the same thread is looked for when the lock is taken, among the
    functions that this thread runs: a step that gets it at once pays nothing for it.
    """

    def __init__(self, holders: Collection[CodeType]) -> None:
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


Value = TypeVar("Value")


class ReadOnly(Generic[Value]):
    """A property that refuses assignment; made by the decorator `read_only`."""

    def __init__(self, get: Callable[[Any], Value], instead: str) -> None:
        self._get, self._instead = get, instead
        self.__doc__ = get.__doc__

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = f"{owner.__name__}.{name}"

    @overload
    def __get__(self, instance: None, owner: type) -> Self: ...

    @overload
    def __get__(self, instance: object, owner: type) -> Value: ...

    def __get__(self, instance: object | None, owner: type) -> Value | Self:
        return self if instance is None else self._get(instance)

    def __set__(self, instance: object, value: object) -> NoReturn:
        raise ImmutableError(f"{self._name} cannot be assigned: {self._instead}")


def read_only(
    instead: str = "build another one",
) -> Callable[[Callable[[Any], Value]], ReadOnly[Value]]:
    """Return a decorator for a read-only property."""
    return lambda get: ReadOnly(get, instead)
