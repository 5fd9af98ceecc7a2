"""The handle of a controller's stream, by which it is commanded."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any

import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.errors import ControllerError, StreamError
from hsp_control.common.keywords import suggesting_methods
from hsp_control.declaration import within
from hsp_control.declaration.located import KeyPath
from hsp_control.trajectories.streams.message import Axes
from hsp_control.trajectories.streams.run import StreamRun


@suggesting_methods
class StreamHandle:
    """A stream of a controller, in its current run; see `Controller.stream`.

    `send` and `send_chunk` may be called from any thread, before the first step, too.
    Counters and the record are those of the present run, or of the last one in which
    something followed it; then these two raise a `StreamError`.
    """

    def __init__(
        self,
        find: Callable[[], StreamRun],
        on_send: Callable[[], None],
        place: KeyPath = (),
    ) -> None:
        """Set the function that returns the stream of the present run.

        ``on_send`` is called with each message; ``place`` is that of the stream in
        errors.
        """
        self._find, self._on_send, self._place = find, on_send, place
        self._last = find()

    def _run(self) -> StreamRun:
        """Return the stream of the present run; the last one if nothing follows it."""
        with suppress(ControllerError):
            self._last = self._find()
        return self._last

    def _followed(self) -> StreamRun:
        try:
            return self._find()
        except ControllerError as error:
            raise StreamError(
                f"nothing follows this stream any more: {error}"
            ) from None

    def send(
        self,
        value: ArrayLike | pin.SE3 | None = None,
        *,
        velocity: ArrayLike | None = None,
        axes: Axes | None = None,
        t: float | None = None,
    ) -> None:
        """Send a target, or a velocity; see `StreamRun.send`."""
        with within(*self._place):
            self._followed().send(value, velocity=velocity, axes=axes, t=t)
        self._on_send()

    def send_chunk(
        self,
        values: ArrayLike,
        times: ArrayLike,
        *,
        velocities: ArrayLike | None = None,
        t: float | None = None,
    ) -> None:
        """Send waypoints; see `StreamRun.send_chunk`."""
        with within(*self._place):
            self._followed().send_chunk(values, times, velocities=velocities, t=t)
        self._on_send()

    def counts(self) -> dict[str, float]:
        """Return the time since the last message [s], and the number of messages."""
        return self._run().counts()

    @property
    def record(self) -> tuple[Mapping[str, Any], ...]:
        """The messages that the run has read, and when; see `Streamed.messages`."""
        return self._run().record

    @property
    def last_rejection(self) -> str:
        """Error of the last invalid message from another process; empty for none."""
        return self._run().last_rejection

    def __repr__(self) -> str:
        return f"StreamHandle of {self._run()!r}"
