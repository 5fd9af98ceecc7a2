"""The lock of a controller, which several threads may share."""

import os
import sys
from collections.abc import Iterator
from functools import cached_property
from threading import RLock, get_ident
from weakref import WeakSet

from hsp_control.common.errors import ControllerError


class StepLock:
    """A lock: other threads wait for it; re-entry by its holder raises."""

    __slots__ = ("__weakref__", "_last", "_lock", "_taken")

    def __init__(self) -> None:
        self._lock, self._taken = RLock(), ""  # why it cannot be acquired, if so
        self._last = 0  # the thread that held it last
        _locks.add(self)

    @property
    def was_mine(self) -> bool:
        """Whether this thread was the last one to hold it, and does not any more."""
        return self._last == get_ident() and not self._taken

    def __enter__(self) -> None:
        self._lock.acquire()
        if self._taken:  # by this thread: others are still waiting
            self._lock.release()
            raise ControllerError(self._taken)
        self._taken, self._last = _BY_ITSELF, get_ident()

    def __exit__(self, *_: object) -> None:
        self._taken = ""
        self._lock.release()

    def forked(self) -> None:
        """Replace the lock in a forked process, which lacks its holder's thread."""
        if self._lock.acquire(blocking=False):  # free, or held by this thread
            self._lock.release()
            return
        # Its holder was in a step, or just before one or after it.
        self._lock, self._taken = RLock(), _FORKED if self._taken else ""


_BY_ITSELF = (
    "a step of a controller calls the same controller, for example within a field: it "
    "would wait for itself for ever; use the state that the field is given, or a copy, "
    "controller.preview()"
)
_FORKED = (
    "this process was forked while another thread computed with this controller, whose "
    "memory stays in the middle of a step here: make the controller in each process, "
    'or start processes by "spawn"'
)
_locks: WeakSet[StepLock] = WeakSet()


def _after_fork() -> None:
    for each in [*_locks]:
        each.forked()
    if sys.version_info < (3, 12):
        # They have one lock for all objects of a class, which a thread may have held.
        for kind in _subclasses(object):
            for member in vars(kind).values():
                if isinstance(member, cached_property):
                    member.lock = RLock()  # type: ignore[attr-defined]


def _subclasses(kind: type) -> Iterator[type]:
    own: list[type] = type.__subclasses__(kind)  # `type` itself has another method
    for each in own:
        yield each
        yield from _subclasses(each)


if hasattr(os, "register_at_fork"):  # where processes can fork
    os.register_at_fork(after_in_child=_after_fork)
