"""The common fields of streams: the source of messages, and how they are followed."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NoReturn, Self

from pydantic import AfterValidator

from hsp_control.common.errors import StreamError, TrajectoryError
from hsp_control.declaration.part import Part
from hsp_control.declaration.quantities import NonNegative, Positive
from hsp_control.trajectories.streams.bounds import MotionBounds
from hsp_control.trajectories.streams.chart import State
from hsp_control.trajectories.streams.message import Axes, Space, message_of
from hsp_control.trajectories.streams.planner import Policy
from hsp_control.trajectories.streams.sources import (
    is_address,
    kind_of,
    read_recording,
    recorded,
)


class Streamed(Part, error=TrajectoryError):
    """A reference that is commanded at run time; a value.

    A controller that follows it has its stream: ``controller.stream("hand")`` accepts
    targets, velocities or chunks of waypoints from any thread, at any rate, late or out
    of order. The reference is C², x' and x'' are exactly its derivatives, and speed,
    acceleration and jerk keep their bounds for any messages. Until the first message it
    rests at its start. Invalid messages are refused; those of another process are
    reported in the statistics, and the reference continues without them.

    The reference is at a target ``delay`` after the target's time, or as soon as the
    bounds permit. It follows quintics if they keep the bounds, and otherwise Ruckig's
    fastest motion.

    * ``interpolate``: the reference passes through all waypoints, with velocities and
      accelerations estimated from them. If no more follow, it brakes and comes to rest
      at the last one, as at a single target.
    * ``latest``: only the newest message is followed; the reference comes to rest at
      its last waypoint. For single targets that replace each other, such as those of a
      dragged hand.
    * ``extrapolate``: it continues from the last one at the velocity estimated from the
      waypoints, for a time, and then comes to rest.

    A velocity alone, as of a joystick, is reached within the bounds and kept; the
    position is its integral. Without another message for ``dead_man``, it fades to
    zero. A velocity beyond the bounds keeps its direction.
    """

    _: KW_ONLY
    source: str | None = None
    """Source of messages: ``udp://HOST:PORT`` for JSON datagrams, or
    ``udp://HOST:PORT/PART`` of a shared port; ``ros2://TOPIC`` for poses of ROS 2; or
    the path of a recording, of JSON lines with a time ``at`` [-]; by default `send`."""
    messages: Annotated[Sequence[Mapping[str, Any]], AfterValidator(tuple)] | None = (
        None
    )
    """A recording, instead of a source: messages with their times ``at`` [s]; a log
    contains those of its run."""
    policy: Literal["interpolate", "latest", "extrapolate"] = "interpolate"
    """The way in which waypoints are followed."""
    delay: NonNegative = 0.1
    """Delay of the reference after a waypoint's own time [s]. For
    ``interpolate`` choose the time between two messages, plus their jitter, plus
    ``smoothing``."""
    smoothing: NonNegative = 0.0
    """Waypoints not farther in time than this are smoothed by a parabola [s]; for noisy
    trackers. For ``interpolate`` and ``extrapolate``."""
    extrapolation: NonNegative = 0.1
    """Time for which the reference continues at the last velocity [s]."""
    dead_man: Positive | None = None
    """Time after which a velocity that was sent alone fades to zero, unless another one
    arrives (a dead man's switch) [s]; by default ``extrapolation``."""
    hold_after: Positive | None = None
    """Time without a message after which the reference comes to rest [s]; never by
    default."""
    stop_after: Positive | None = None
    """Time without a message after which the run is stopped [s]; a live loop brakes and
    holds. Never by default."""

    space: ClassVar[Space]
    axes: ClassVar[Axes] = "world"

    def __post_init__(self) -> None:
        """Check the source."""
        if self.source is not None and self.messages is not None:
            raise StreamError("give either source or messages")
        if self.source is not None and is_address(self.source):
            kind_of(self.source).check_address(self.source)
        if (
            self.messages is not None
        ):  # their content is checked where its type is known
            recorded(self.messages, Space(None, False))

    @property
    def live(self) -> bool:
        """Whether another process feeds it, in real time."""
        return self.source is not None and is_address(self.source)

    @property
    def listens_to(self) -> str:
        """The source of its messages, instead of `send`; empty: none."""
        return self.source or ("a recording" if self.messages is not None else "")

    def recorded_in(self, folder: Path, allow: Callable[[Path], object]) -> Self:
        """Return the stream with the messages of its recording, if it names one."""
        if self.source is None or self.live:
            return self
        path = folder / self.source
        allow(path)
        return replace(self, source=None, messages=read_recording(path))

    def check(self, dimension: int | None = None, **message: Any) -> None:
        """Raise if a message is not valid, before there is a run; see `StreamRun.send`.

        Args:
            dimension: The number of linear coordinates, if the stream does not define
            it.
            message: The arguments of `send`.
        """
        known = self.space.linear if dimension is None else dimension
        message_of(message, self.space._replace(linear=known))

    @property
    def how(self) -> Policy:
        """The conversion of messages to goals."""
        return Policy(
            self.policy,
            self.delay,
            self.smoothing,
            self.extrapolation,
            inf if self.hold_after is None else self.hold_after,
            inf if self.stop_after is None else self.stop_after,
            self.extrapolation if self.dead_man is None else self.dead_man,
            self.axes,
        )

    @property
    def relative(self) -> bool:
        """True: it moves only in a run; see `Trajectory.anchored`."""
        return True

    def begin(self) -> State:
        """Return the reference before the first message.

        Raises:
            StreamError: If it begins at a robot's start.
        """
        raise NotImplementedError

    def bounds(self) -> MotionBounds:
        """Return the bounds in the coordinates of the chart."""
        raise NotImplementedError

    def sample(self, t: float, out: Any = None) -> NoReturn:
        """Raise: a stream moves in a run; see `Trajectory.anchored`."""
        raise self._placeless()

    def _placeless(self) -> StreamError:
        """Return the error of a stream without a controller."""
        return StreamError(
            f"this {type(self).__name__} is declared, and moves where a controller "
            "follows it: controller.stream('hand') has its messages; without a "
            "controller, stream.anchored(start).run has"
        )
