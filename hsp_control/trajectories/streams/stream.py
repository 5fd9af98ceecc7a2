"""References that are streamed while the robot moves: points, orientations, poses."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, replace
from math import inf
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import AfterValidator

from hsp_control.common.exceptions import StreamError, TrajectoryError
from hsp_control.declaration.families import value_fields
from hsp_control.declaration.nested import Remembering
from hsp_control.declaration.quantities import (
    NonNegative,
    Positive,
    PositiveNumbers,
    Vector,
    Vector3,
)
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.engine.plans import PartCalls
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.pose import PoseSample, PoseTrajectory
from hsp_control.trajectories.streams.alone import StreamAlone
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.inbox import Reader
from hsp_control.trajectories.streams.mailbox import (
    Mailbox,
    is_address,
    kind_of,
    read_recording,
    recorded,
)
from hsp_control.trajectories.streams.message import ORIENTATION, POSE, Space
from hsp_control.trajectories.streams.running import Policy, RunningStream
from hsp_control.trajectories.streams.segments import (
    MotionBounds,
    angular_bounds,
    linear_bounds,
)
from hsp_control.trajectories.streams.velocities import Axes
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample


class Streamed(Remembering, error=TrajectoryError):
    """A reference that any thread or process feeds while the robot moves.

    `send` gives targets, velocities or chunks of waypoints, at any rate, late or out of
    order. The reference is C², x' and x'' are exactly its derivatives, and speed,
    acceleration and jerk keep their bounds, whatever is sent. Until the first message
    it stays where it starts. Invalid messages are refused; those of another process are
    counted, and the reference goes on without them.

    The reference is at a target ``delay`` after the target's time, or as soon as the
    bounds permit. On its way it follows quintics where they keep the bounds, and
    otherwise Ruckig's fastest motion.

    * ``interpolate``: the reference passes through all waypoints, with the velocities
      and accelerations that they show. If no more follow, it brakes at the last one,
      and comes to rest there, as it does at a single target.
    * ``latest``: only the newest message counts; the reference comes to rest at its
      last waypoint. For single targets that replace each other, such as a hand that
      is dragged.
    * ``extrapolate``: it goes on from the last one at the velocity that the waypoints
      show, for a time, and then comes to rest.

    A velocity alone, as a joystick sends it, is reached within the bounds and kept; the
    position is its integral. If no other message comes for ``dead_man``, it fades to
    zero. One beyond the bounds keeps its direction.

    A value of a stream is shared: whoever has it may send, and each controller that
    follows it hears all.
    """

    _: KW_ONLY
    source: str | None = None
    """Where messages come from: ``udp://HOST:PORT`` for JSON datagrams, or
    ``udp://HOST:PORT/PART`` of a shared port; ``ros2://TOPIC`` for poses of ROS 2; or
    the path of a recording, of JSON lines with a time ``at`` [-]; by default `send`."""
    messages: Annotated[Sequence[Mapping[str, Any]], AfterValidator(tuple)] | None = (
        None
    )
    """A recording, instead of a source: messages with the times ``at`` [s] at which
    they are taken; a log contains those of its run."""
    policy: Literal["interpolate", "latest", "extrapolate"] = "interpolate"
    """How waypoints are followed."""
    delay: NonNegative = 0.1
    """Time from a waypoint's own time to when the reference is there [s]. For
    ``interpolate`` choose the time between two messages, plus their jitter, plus
    ``smoothing``."""
    smoothing: NonNegative = 0.0
    """Waypoints not farther in time than this are smoothed by a parabola [s]; for noisy
    trackers. For ``interpolate`` and ``extrapolate``."""
    extrapolation: NonNegative = 0.1
    """How long the reference goes on at the last velocity [s]."""
    dead_man: Positive | None = None
    """Time after which a velocity that was sent alone fades to zero, unless another one
    comes (a dead man's switch) [s]; by default ``extrapolation``."""
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
        if self.messages is not None:  # what they carry is checked where it is known
            recorded(self.messages, Space(None, False))
        vars(self)["_mailbox"] = Mailbox(self._hears, self.space)

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
                x, y, z and a quaternion, or a pin.SE3; None: only the velocity counts.
            velocity: The velocity at the target, in world axes; or alone, as a joystick
                sends it: linear velocities, then angular ones [1/s].
            axes: Those of a velocity alone: ``world``, or ``tool``, the axes of the
                moving body; None: the stream's own.
            t: The target's time by the sender's clock [s]; None: now.

        Raises:
            StreamError: If it is not valid, or the stream has another source.
        """
        if isinstance(value, pin.SE3):
            value = pin.SE3ToXYZQUAT(value)
        self._mailbox.put(value=value, velocity=velocity, axes=axes, t=t)

    def send_chunk(
        self,
        values: ArrayLike,
        times: ArrayLike,
        *,
        velocities: ArrayLike | None = None,
        t: float | None = None,
    ) -> None:
        """Send waypoints, which replace all that were to follow; from any thread.

        Args:
            values: The waypoints, shape (k, width), each as in `send`.
            times: Their times after ``t``, increasing, shape (k,) [s].
            velocities: Their velocities; None: those that the waypoints show.
            t: When the chunk was made, by the sender's clock [s]; None: now.

        Raises:
            StreamError: If it is not valid, or the stream has another source.
        """
        self._mailbox.put(values=values, times=times, velocities=velocities, t=t)

    def recorded_in(self, folder: Path, allow: Callable[[Path], object]) -> Self:
        """Return the stream with the messages of its recording, if it names one."""
        if self.source is None or self.live:
            return self
        path = folder / self.source
        allow(path)
        return replace(self, source=None, messages=read_recording(path))

    @property
    def record(self) -> tuple[Mapping[str, Any], ...]:
        """What the last run has taken, and when; see ``messages``.

        Where no log is written, only the first messages.
        """
        reader = self._mailbox.reader
        taken = reader.record if reader is not None else []
        return tuple(each.to_dict() for each in taken)

    def log(self) -> None:
        """Record all that is taken from now on, up to five million numbers."""
        self._mailbox.log()

    @property
    def last_rejection(self) -> str:
        """Why the last invalid message of another process was one; empty for none."""
        return self._mailbox.inbox.reason

    @property
    def unrecorded(self) -> int:
        """How many messages of the last run the record had no room for."""
        reader = self._mailbox.reader
        return reader.lost if reader is not None else 0

    def counts(self) -> dict[str, float]:
        """Return the time since the last message [s], and how many there were.

        ``taken``: all valid ones; ``late``: of these, those that came too late to
        count; ``rejected``: invalid ones, and those that no motion can follow.
        The stream that a controller follows counts,
        ``controller.stream(task)``.

        Raises:
            StreamError: If it begins where a robot starts, and no controller follows
                it.
        """
        running = self.running
        return {
            "age": running.age,
            "taken": running.taken,
            "late": running.waypoints.late,
            "rejected": self._mailbox.inbox.rejected + running.refused,
        }

    @property
    def is_placed(self) -> bool:
        """Whether it is a controller's, and goes on from run to run."""
        return bool(vars(self).get("_is_placed", False))

    @property
    def live(self) -> bool:
        """Whether another process feeds it, in real time."""
        return self.source is not None and is_address(self.source)

    @property
    def _hears(self) -> str:
        """What it hears besides `send`; empty: nothing."""
        return self.source or ("a recording" if self.messages is not None else "")

    @property
    def _mailbox(self) -> Mailbox:
        mailbox: Mailbox = vars(self)["_mailbox"]
        return mailbox

    def _shared(self, other: Self) -> Self:
        """Return another value of the same stream, which hears what this one hears."""
        vars(other)["_mailbox"] = self._mailbox
        for name in ("_previews", "_is_alone"):
            vars(other)[name] = vars(self).get(name, False)
        return other

    def _placed(self, placed: Self) -> Self:
        """Return this stream, placed."""
        if placed.messages is not None:
            start, rotational = placed._start(), placed.space.rotational
            recorded(placed.messages, Space(len(start.x) - 3 * rotational, rotational))
        vars(placed)["_is_placed"] = True
        return self._shared(placed)

    def like(self, kind: "type[Streamed]") -> "Streamed":
        """Return the stream as one of another kind, which hears the same."""
        if isinstance(self, kind):
            return self
        settings = self.changed_fields()
        known = {field.name for field in value_fields(kind)}
        if unknown := [name for name in settings if name not in known]:
            raise TrajectoryError(f"{unknown[0]} is no setting of a {kind.__name__}")
        made = kind(**settings)
        vars(made)["_mailbox"] = self._mailbox
        self._mailbox.inbox.space = made.space
        return made

    @property
    def running(self) -> RunningStream:
        """The reference of the present run; begun when first asked for."""
        if "_running" not in vars(self):
            vars(self)["_running"] = self._begin()
        running: RunningStream = vars(self)["_running"]
        return running

    def without_python(self) -> Self:
        """Return a stream that hears only what a program sends; see `StreamAlone`."""
        copy = self.preview()
        vars(copy)["_is_alone"] = True
        return copy

    @property
    def alone(self) -> StreamAlone:
        """What computes it without Python."""
        if "_alone" not in vars(self):
            start = self._start()
            given = self._chart(start), self._bounds(), self._how, start
            vars(self)["_alone"] = StreamAlone(*given)
        alone: StreamAlone = vars(self)["_alone"]
        return alone

    def calls(self, out: Any) -> PartCalls:
        """Return the calls that write a sample; see `Trajectory.calls`."""
        if vars(self).get("_is_alone", False):
            return self.alone.calls(out)
        calls: PartCalls = super().calls(out)  # type: ignore[misc]
        return calls

    def _chart(self, start: State) -> Chart:
        rotational = self.space.rotational
        return Chart(len(start.x) - 3 * rotational, rotational)

    @property
    def _how(self) -> Policy:
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

    def _begin(self) -> RunningStream:
        start = self._start()
        chart = self._chart(start)
        source = self._opened(Space(chart.linear, chart.rotational))
        return RunningStream(chart, self._bounds(), self._how, source, start)

    def _opened(self, space: Space) -> Reader:
        kept = not vars(self).get("_previews", False)
        messages: Sequence[Mapping[str, Any]] | None = self.messages
        if self.source is not None and not is_address(self.source):
            messages = read_recording(Path(self.source))
        if messages is not None:
            taken = recorded(messages, space)
            return self._mailbox.recording(space, taken, kept=kept)
        return self._mailbox.live(space, kept=kept)

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields, and where the reference is in its run, if it runs."""
        state = super().__getstate__()
        for name in ("_mailbox", "_running", "_is_placed", "_previews"):
            if name in vars(self):
                state[name] = vars(self)[name]
        return state

    def __deepcopy__(self, memo: dict[int, Any]) -> Self:
        """Return the value itself; once it is placed, one that goes on by itself."""
        if not self.is_placed:
            return self
        copy: Self | None = memo.get(id(self))
        if copy is None:
            memo[id(self)] = copy = self.preview()
            if "_running" in vars(self):
                vars(copy)["_running"] = self.running.copy()
        return copy

    def catch_up(self) -> None:
        """Hear what the run that it previews has heard already, each at its time.

        As far as the record goes: see `record`.
        """
        if (reader := self._mailbox.reader) is not None:
            self.running.catch_up(reader)

    def preview(self) -> Self:
        """Return a stream that hears the same, but counts as heard for itself alone."""
        copy = self._shared(replace(self))
        vars(copy)["_previews"] = True
        vars(copy)["_is_placed"] = self.is_placed
        return copy

    def _start(self) -> State:
        """Return where the reference is before the first message."""
        raise NotImplementedError

    def _placeless(self) -> StreamError:
        """Return the error of a stream that begins where a robot starts."""
        return StreamError(
            f"this {type(self).__name__} begins where a robot starts, and no "
            "controller follows it; that of a controller is its task's, for example "
            "controller.stream('hand')"
        )

    def _bounds(self) -> MotionBounds:
        """Return the bounds in the coordinates of the chart."""
        raise NotImplementedError


class Stream(Streamed, Trajectory, type="stream"):
    """x(t) in Rⁿ that is streamed: the position of a point, or a posture.

    The bounds hold for each coordinate.
    """

    space: ClassVar[Space] = Space(None, False)
    points: ClassVar[tuple[str, ...]] = ("start",)

    start: Vector | None = None
    """Where it is until the first message, shape (n,) [m, or the task's unit]; where
    the robot starts by default."""
    _: KW_ONLY
    speed: PositiveNumbers = 1.0
    """Bound on |x'|, one number or n [1/s]."""
    acceleration: PositiveNumbers = 5.0
    """Bound on |x''|, one number or n [1/s²]."""
    jerk: PositiveNumbers = 200.0
    """Bound on |x'''|, one number or n [1/s³]."""

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return 0 if self.start is None else np.size(self.start)

    def anchored(self, start: ArrayLike | None) -> Self:
        """Return the stream for a new run; see `Trajectory.anchored`."""
        if self.origin == "start":
            raise TrajectoryError(
                "a stream has no points that origin: start could move"
            )
        placed = super().anchored(start)
        return self._placed(replace(self) if placed is self else placed)

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x(t), x'(t) and x''(t); see `Trajectory.sample`."""
        out = self._output(out)
        state = self.running.at(t)
        out.position[:], out.velocity[:] = state.x, state.rate
        out.acceleration[:] = state.acceleration
        return out

    def _start(self) -> State:
        if self.start is None:
            raise self._placeless()
        return Chart(self.dimension, False).begin(np.asarray(self.start), np.eye(3))

    def _bounds(self) -> MotionBounds:
        return linear_bounds(self.speed, self.acceleration, self.jerk, self.dimension)


class Turning(Streamed):
    """A stream with a rotation."""

    _: KW_ONLY
    axes: Axes = "world"  # type: ignore[misc]  # a field, where there is a tool
    """Axes of velocities that are sent alone and name none [-]: ``world``, in a
    relative task those of its reference, or ``tool``, those of the moving body."""
    angular_speed: Positive = 2.5
    """Bound on |ω| [rad/s]."""
    angular_acceleration: Positive = 20.0
    """Bound on |ω'| [rad/s²]."""
    angular_jerk: Positive = 1000.0
    """Bound on |ω''| [rad/s³]."""

    def __post_init__(self) -> None:
        """Check the source and the bounds."""
        super().__post_init__()
        self._bounds()

    @property
    def _turning(self) -> MotionBounds:
        """The bounds on a rotation vector."""
        return angular_bounds(
            self.angular_speed, self.angular_acceleration, self.angular_jerk
        )


class StreamOrientation(Turning, OrientationTrajectory, type="stream"):
    """R(t) that is streamed, as quaternions (x, y, z, w) or angular velocities.

    The bounds hold for the magnitudes of ω, ω' and ω'', in every direction.
    """

    space: ClassVar[Space] = ORIENTATION

    rotation: Rotation | None = None
    """The orientation until the first message, body to world: roll, pitch and yaw
    [rad], a quaternion or a matrix [-]; that in which the robot starts by default."""

    def anchored(self, start: ArrayLike) -> Self:
        """Return the stream for a new run; see `OrientationTrajectory.anchored`."""
        placed = super().anchored(start)
        return self._placed(replace(self) if placed is self else placed)

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R(t), ω(t) and ω'(t); see `OrientationTrajectory.sample`."""
        out = self._output(out)
        running = self.running
        running.chart.write_orientation(running.at(t), out)
        return out

    def _start(self) -> State:
        if self.rotation is None:
            raise self._placeless()
        return Chart(0, True).begin(np.zeros(0), matrix_of(self.rotation))

    def _bounds(self) -> MotionBounds:
        return self._turning


class StreamPose(Turning, PoseTrajectory, type="stream"):
    """M(t) that is streamed, as x, y, z and a quaternion, or as twists in world axes.

    The linear bounds hold for each coordinate, the angular ones in every direction.
    """

    space: ClassVar[Space] = POSE

    position: Vector3 | None = None
    """The origin until the first message, shape (3,) [m]; where the robot starts by
    default."""
    rotation: Rotation | None = None
    """The orientation until then, body to world: roll, pitch and yaw [rad], a
    quaternion or a matrix [-]; that in which the robot starts by default."""
    _: KW_ONLY
    speed: PositiveNumbers = 0.5
    """Bound on |x'|, one number or three [m/s]."""
    acceleration: PositiveNumbers = 5.0
    """Bound on |x''|, one number or three [m/s²]."""
    jerk: PositiveNumbers = 200.0
    """Bound on |x'''|, one number or three [m/s³]."""

    @property
    def relative(self) -> bool:
        """Whether it depends on where the robot starts."""
        return self.position is None or self.rotation is None

    def anchored(self, start: pin.SE3) -> Self:
        """Return the stream for a new run, from where the robot starts."""
        given: dict[str, Any] = {
            "position": start.translation if self.position is None else self.position,
            "rotation": start.rotation if self.rotation is None else self.rotation,
        }
        return self._placed(replace(self, **given))

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        if self.relative:
            raise TrajectoryError(
                "StreamPose begins where the robot starts, which only a controller "
                "knows; give position and rotation, or `anchored`"
            )
        if out is None:
            out = PoseSample.allocate()
        running = self.running
        state, position = running.at(t), out.position
        position.position[:], position.velocity[:] = state.x[:3], state.rate[:3]
        position.acceleration[:] = state.acceleration[:3]
        running.chart.write_orientation(state, out.orientation)
        return out

    def _start(self) -> State:
        if self.position is None or self.rotation is None:
            raise self._placeless()
        where = np.asarray(self.position)
        return Chart(3, True).begin(where, matrix_of(self.rotation))

    def _bounds(self) -> MotionBounds:
        moving = linear_bounds(self.speed, self.acceleration, self.jerk, 3)
        turning = self._turning
        return MotionBounds(*map(np.concatenate, zip(moving, turning, strict=True)))


def stream_for(followed: object, stream: Streamed) -> Any:
    """Return a stream of the kind that can follow a reference."""
    if isinstance(followed, PoseTrajectory):
        return stream if isinstance(stream, Stream) else stream.like(StreamPose)
    if isinstance(followed, OrientationTrajectory):
        return stream.like(StreamOrientation)
    return stream.like(Stream)
