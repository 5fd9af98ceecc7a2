"""A lock that a step of a controller holds."""

from threading import RLock

from hsp_control.common.exceptions import ControllerError


class StepLock:
    """A lock: other threads wait for it, and the thread that has it is told."""

    __slots__ = ("_held", "_lock")

    def __init__(self) -> None:
        self._lock, self._held = RLock(), False

    def __enter__(self) -> None:
        self._lock.acquire()
        if self._held:  # by this thread: others are still waiting
            self._lock.release()
            raise ControllerError(
                "a step of a controller calls the same controller, for example within "
                "a field: it would wait for itself for ever; use the state that the "
                "field is given, or a copy, controller.preview()"
            )
        self._held = True

    def __exit__(self, *_: object) -> None:
        self._held = False
        self._lock.release()
