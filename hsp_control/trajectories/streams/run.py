"""A stream in one run: its messages, and the resulting reference."""

from collections.abc import Mapping
from copy import copy, deepcopy
from dataclasses import replace
from pathlib import Path
from typing import Any

import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.errors import StreamError
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.inbox import Inbox, Reader
from hsp_control.trajectories.streams.message import Axes, Space
from hsp_control.trajectories.streams.planner import SOON, Planner, Room
from hsp_control.trajectories.streams.sources import (
    is_address,
    listening_inbox,
    read_recording,
    recorded,
)
from hsp_control.trajectories.streams.streamed import Streamed


class StreamRun:
    """A stream in one run of a controller: reads messages, and plans the reference.

    A controller stores the runs of its streams. A copy or a pickle continues from the
    present state, with the messages that wait, and receives the later ones to itself. A
    copy of a stream that listens to a source, and one with a `shared` queue, receives
    the messages to this one, and leaves them there; once it is sent to itself, only its
    own.

    Attributes:
        declared: The declared stream; the next run begins with the untaken messages to
        the stream of this value.
        stream: The stream, with the start of the run.
    """

    def __init__(self, declared: Streamed, stream: Streamed) -> None:
        """Begin at rest."""
        self.declared, self.stream = declared, stream
        self._start, rotational = stream.begin(), stream.space.rotational
        self.chart = Chart(len(self._start.x) - 3 * rotational, rotational)
        self._space = Space(self.chart.linear, rotational)
        self._inbox = Inbox(self._space)
        self._aside = self._logged = False
        self._period_alone: float | None = None  # of a run without Python
        self._reader: Reader | None = None
        self._planner: Planner | None = None
        if stream.listens_to and not stream.live:
            self._reader = self._opened()  # a bad recording stops no moving robot

    # -- messages ---------------------------------------------------------------------

    def send(
        self,
        value: ArrayLike | pin.SE3 | None = None,
        *,
        velocity: ArrayLike | None = None,
        axes: Axes | None = None,
        t: float | None = None,
    ) -> None:
        """Send a target, or a velocity; from any thread.

        Args:
            value: The target: n coordinates, a quaternion (x, y, z, w), or for a pose
                x, y, z and a quaternion, or a pin.SE3; None: a velocity alone.
            velocity: The velocity at the target, in world axes; or alone, as of a
            joystick: linear velocities, then angular ones [1/s].
            axes: The axes of a velocity alone: ``world``, or ``tool``, the axes of the
                moving body; None: the stream's own.
            t: The target's time by the sender's clock [s]; None: now.

        Raises:
            StreamError: If it is not valid, or the stream has another source.
        """
        if isinstance(value, pin.SE3):
            value = pin.SE3ToXYZQUAT(value)
        self._put(value=value, velocity=velocity, axes=axes, t=t)

    def send_chunk(
        self,
        values: ArrayLike,
        times: ArrayLike,
        *,
        velocities: ArrayLike | None = None,
        t: float | None = None,
    ) -> None:
        """Send waypoints, which replace all later ones; from any thread.

        Args:
            values: The waypoints, shape (k, width), each as in `send`.
            times: Their times after ``t``, increasing, shape (k,) [s].
            velocities: Their velocities; None: estimated from the waypoints.
            t: The time of the chunk by the sender's clock [s]; None: now.

        Raises:
            StreamError: If it is not valid, or the stream has another source.
        """
        self._put(values=values, times=times, velocities=velocities, t=t)

    def _put(self, **message: Any) -> None:
        if self.stream.listens_to:
            raise StreamError(
                f"this stream receives from {self.stream.listens_to}; send needs a "
                "stream without source and messages"
            )
        if self._aside:  # a copy's own commands are not the original's
            memo: dict[int, Any] = {}
            self._inbox = deepcopy(self._inbox, memo)
            self._reader, self._aside = deepcopy(self._reader, memo), False
        self._inbox.put(**message)

    def follow(self, before: "StreamRun") -> None:
        """Take over the untaken messages of another run's stream.

        Raises:
            StreamError: If that stream has another number of coordinates.
        """
        if before._space != self._space:
            raise StreamError(
                f"this stream already carries {before._space.width} numbers; here "
                f"{self._space.width} are needed"
            )
        self._inbox = before._inbox
        self._aside, self._logged = before._aside, before._logged
        self._period_alone = before._period_alone

    @property
    def inbox(self) -> Inbox:
        """The queue that it reads: that of `send`, or of its source once it runs."""
        return self._inbox if self._reader is None else self._reader.inbox

    @property
    def reader(self) -> Reader:
        """The reader of its messages; a source is opened here."""
        if self._reader is None:
            self._reader = self._opened()
            self._reader.logged = self._logged
        return self._reader

    def _opened(self) -> Reader:
        source, messages = self.stream.source, self.stream.messages
        if source is not None and is_address(source):
            return Reader(listening_inbox(source, self._space), aside=self._aside)
        if source is not None:
            messages = read_recording(Path(source))
        if messages is not None:
            where = "" if source is None else source
            taken = recorded(messages, self._space, where)
            return Reader(Inbox.recorded(self._space, taken), aside=True)
        return Reader(self._inbox, aside=self._aside)

    # -- statistics ----------------------------------------------------------

    def counts(self) -> dict[str, float]:
        """Return the time since the last message [s], and the numbers of messages.

        ``taken``: all valid ones; ``late``: of these, those that arrived too late to be
        used; ``rejected``: invalid ones, and those that no motion can follow.
        """
        planner = self._planned
        return {
            "age": planner.age,
            "taken": planner.count("taken"),
            "late": planner.count("late"),
            "rejected": self.inbox.rejected + planner.count("refused"),
        }

    @property
    def last_rejection(self) -> str:
        """Why the last invalid message of another process was rejected, or ""."""
        return self.inbox.reason

    def log(self) -> None:
        """Record all messages taken from now on, up to five million numbers."""
        self._logged = True
        if self._reader is not None:
            self._reader.logged = True

    @property
    def record(self) -> tuple[Mapping[str, Any], ...]:
        """The messages taken, and their times; see `Streamed.messages`.

        Without a log, only the first messages.
        """
        taken = self._reader.record if self._reader is not None else []
        return tuple(message.to_dict(t) for message, t in taken)

    @property
    def unrecorded(self) -> int:
        """The number of messages for which the record had no room."""
        return self._reader.lost if self._reader is not None else 0

    def repeated(self) -> Streamed:
        """Return the declaration of a stream that replays the same messages."""
        return replace(self.stream, source=None, messages=self.record)

    # -- the reference ----------------------------------------------------------------

    def bring(self, t: float) -> None:
        """Bring `state` to the reference at a time [s].

        Messages are taken up to a later time than the last one.

        Raises:
            StreamError: If there was no message for too long, the listener has ended,
            or the time is long past.
        """
        planner = self._planned
        if t > planner.now:
            reader = self.reader  # a source that cannot be opened raises in step one
            planner.advance(t, reader.take(t) if planner.begun else ())
        else:
            planner.bring(t)

    @property
    def state(self) -> State:
        """The state that `bring` writes, always the same arrays."""
        return self._planned.state

    def keep(self, since: float, until: float) -> None:
        """Keep the reference from a time on until a later one [s]."""
        self._planned.keep(since, until)

    def rehearse(self) -> None:
        """Take the messages that wait, and plan with them; nothing of it stays."""
        planner = self._planned
        reader = self.reader.copy()
        planner.rehearse(reader.take(planner.now + SOON) if planner.begun else [])

    @property
    def _planned(self) -> Planner:
        if self._planner is None:
            bounds, how = self.stream.bounds(), self.stream.how
            period = self._period_alone
            room = Room() if period is None else Room.without_python(how, period)
            self._planner = Planner(self.chart, bounds, how, self._start, room)
            self._planner.rehearse()
        return self._planner

    # -- without Python ---------------------------------------------------------------

    @property
    def shared(self) -> dict[int, Any]:
        """The memo of `deepcopy` for a copy that only reads: the queue itself."""
        return {id(self._inbox): self._inbox}

    def leave_python(self, period: float) -> None:
        """Receive only messages of a program, from the start on.

        Args:
            period: Minimum time between two messages [s].
        """
        self._period_alone, self._planner = period, None

    @property
    def alone(self) -> Planner | None:
        """The planner without Python; None: messages are received in Python."""
        return None if self._period_alone is None else self._planned

    def __repr__(self) -> str:
        return f"StreamRun of {self.declared!r}"

    def __deepcopy__(self, memo: dict[int, Any]) -> "StreamRun":
        """Return a copy that continues independently, with the messages that wait."""
        memo[id(self)] = other = copy(self)
        other._inbox, reader = deepcopy(self._inbox, memo), self._reader
        listens = reader is not None and reader.inbox is not self._inbox
        if listens or other._inbox is self._inbox:  # see `shared`
            other._aside = True
            other._reader = None if reader is None else reader.copy()
        else:
            other._reader = deepcopy(reader, memo)  # of the same copy of the queue
        if self._planner is not None:
            other._planner = self._planner.copy()
        return other
