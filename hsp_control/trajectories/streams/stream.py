"""References that are streamed while the robot moves: points, orientations, poses."""

from dataclasses import KW_ONLY, replace
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.errors import TrajectoryError
from hsp_control.declaration.families import value_fields
from hsp_control.declaration.quantities import (
    Positive,
    PositiveNumbers,
    Vector,
    Vector3,
)
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.trajectories.orientation import OrientationTrajectory
from hsp_control.trajectories.pose import PoseTrajectory
from hsp_control.trajectories.streams.bounds import (
    MotionBounds,
    angular_bounds,
    linear_bounds,
)
from hsp_control.trajectories.streams.chart import Chart, State
from hsp_control.trajectories.streams.followed import (
    FollowedOrientation,
    FollowedPoint,
    FollowedPose,
)
from hsp_control.trajectories.streams.message import ORIENTATION, POSE, Axes, Space
from hsp_control.trajectories.streams.run import StreamRun
from hsp_control.trajectories.streams.streamed import Streamed
from hsp_control.trajectories.trajectory import Trajectory


class Stream(Streamed, Trajectory, type="stream"):
    """x(t) in Rⁿ that is streamed: the position of a point, or a posture.

    The bounds hold for every coordinate.
    """

    space: ClassVar[Space] = Space(None, False)
    points: ClassVar[tuple[str, ...]] = ("start",)

    start: Vector | None = None
    """The point until the first message, shape (n,) [m, or the task's unit]; the
    robot's start by default."""
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

    def anchored(self, start: ArrayLike | None) -> FollowedPoint:
        """Return the stream in a new run; see `Trajectory.anchored`."""
        if self.origin == "start":
            raise TrajectoryError(
                "a stream has no points that origin: start could move"
            )
        if self.start is None and start is None:
            raise TrajectoryError("start is missing: nothing starts here")
        begin: Any = start if self.start is None else self.start
        if start is not None and np.size(begin) != np.size(start):
            raise TrajectoryError(
                f"start has {np.size(begin)} coordinates {np.asarray(begin).tolist()}; "
                f"needs {np.size(start)}"
            )
        return FollowedPoint(StreamRun(self, replace(self, start=begin)))

    def begin(self) -> State:
        """Return its value before the first message; see `Streamed.begin`."""
        if self.start is None:
            raise self._placeless()
        return Chart(self.dimension, False).begin(np.asarray(self.start), np.eye(3))

    def bounds(self) -> MotionBounds:
        """Return the bounds on every coordinate."""
        return linear_bounds(self.speed, self.acceleration, self.jerk, self.dimension)


class Turning(Streamed):
    """A stream with a rotation."""

    _: KW_ONLY
    axes: Axes = "world"  # type: ignore[misc]  # a field, where there is a tool
    """Axes of velocities that are sent alone without axes [-]: ``world``, in a
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
        self.bounds()

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

    def anchored(self, start: ArrayLike) -> FollowedOrientation:
        """Return the stream in a new run; see `OrientationTrajectory.anchored`."""
        begin: Any = start if self.rotation is None else self.rotation
        return FollowedOrientation(StreamRun(self, replace(self, rotation=begin)))

    def begin(self) -> State:
        """Return its value before the first message; see `Streamed.begin`."""
        if self.rotation is None:
            raise self._placeless()
        return Chart(0, True).begin(np.zeros(0), matrix_of(self.rotation))

    def bounds(self) -> MotionBounds:
        """Return the bounds on a rotation vector."""
        return self._turning


class StreamPose(Turning, PoseTrajectory, type="stream"):
    """M(t) that is streamed, as x, y, z and a quaternion, or as twists in world axes.

    The linear bounds hold for every coordinate, the angular ones in every direction.
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

    def anchored(self, start: pin.SE3) -> FollowedPose:
        """Return the stream in a new run, from the robot's start."""
        given: dict[str, Any] = {
            "position": start.translation if self.position is None else self.position,
            "rotation": start.rotation if self.rotation is None else self.rotation,
        }
        return FollowedPose(StreamRun(self, replace(self, **given)))

    def begin(self) -> State:
        """Return its value before the first message; see `Streamed.begin`."""
        if self.position is None or self.rotation is None:
            raise self._placeless()
        where = np.asarray(self.position)
        return Chart(3, True).begin(where, matrix_of(self.rotation))

    def bounds(self) -> MotionBounds:
        """Return the bounds on the coordinates, and on a rotation vector."""
        moving = linear_bounds(self.speed, self.acceleration, self.jerk, 3)
        turning = self._turning
        return MotionBounds(*map(np.concatenate, zip(moving, turning, strict=True)))


def stream_for(followed: object, stream: Streamed) -> Any:
    """Return a stream of the kind that can replace a reference.

    Raises:
        TrajectoryError: If a setting does not exist for a stream of this kind.
    """
    kind: type[Streamed] = Stream
    if isinstance(followed, PoseTrajectory):
        kind = Stream if isinstance(stream, Stream) else StreamPose
    elif isinstance(followed, OrientationTrajectory):
        kind = StreamOrientation
    if isinstance(stream, kind):
        return stream
    settings = stream.changed_fields()
    known = {field.name for field in value_fields(kind)}
    if unknown := [name for name in settings if name not in known]:
        raise TrajectoryError(f"{unknown[0]} is no setting of a {kind.__name__}")
    return kind(**settings)
