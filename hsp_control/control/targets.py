"""Targets of a program: a stream takes over from the reference of a task."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError, TrajectoryError
from hsp_control.declaration.language import shortened
from hsp_control.declaration.quantities import numbers
from hsp_control.declaration.rotation import matrix_of
from hsp_control.robot import RobotState
from hsp_control.tasks import Pointing, Task
from hsp_control.trajectories import (
    Hold,
    OrientationTrajectory,
    PoseTrajectory,
    Stream,
    StreamOrientation,
    StreamPose,
)
from hsp_control.trajectories.crossfade import settled
from hsp_control.trajectories.hold import HoldOrientation
from hsp_control.trajectories.pose import HoldPose
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.streams.run import StreamRun
from hsp_control.trajectories.streams.streamed import Streamed

RAMP = 0.2
"""Ramp of interactive changes [s]."""
DEAD_MAN = 0.2
"""Time after which an unrepeated velocity fades out [s]."""
DELAY = 0.03
"""Time to a target, if the bounds permit [s]: about two of a page's pictures."""
MOVING: dict[str, Any] = {"speed": 0.5, "acceleration": 3.0, "jerk": 60.0}
"""Bounds on the way to a target [m/s, m/s², m/s³]: those that arms can follow, so
that limits rarely bind."""
TURNING: dict[str, Any] = {
    "angular_speed": 1.5,
    "angular_acceleration": 8.0,
    "angular_jerk": 200.0,
}
"""The same for turning [rad/s, rad/s², rad/s³]."""


def new_stream(followed: object) -> Streamed:
    """Return a stream that can take over from a reference."""
    how: dict[str, Any] = {"policy": "latest", "delay": DELAY, "dead_man": DEAD_MAN}
    if isinstance(followed, PoseTrajectory):
        return StreamPose(**MOVING, **TURNING, **how)
    if isinstance(followed, OrientationTrajectory):
        return StreamOrientation(**TURNING, **how)
    return Stream(**MOVING, **how)


def followed_stream(task: Task) -> StreamRun | None:
    """Return the stream that a task follows after all changes; None: it follows none.

    One that reads a source or a recording cannot be sent to.
    """
    run = _run_of(task)
    return None if run is None or run.stream.listens_to else run


def listened_to(task: Task) -> str:
    """Return the source of the stream that a task follows; empty: none."""
    run = _run_of(task)
    return "" if run is None else run.stream.listens_to


def _run_of(task: Task) -> StreamRun | None:
    followed: object = settled(task.followed, np.inf)
    return followed.run if isinstance(followed, FollowedStream) else None


def target_of(task: Task, value: object, here: Callable[[], RobotState]) -> Array:
    """Return a target in the streams' form: numbers, quaternions (x, y, z, w).

    Args:
        task: The task.
        value: The target.
        here: Returns the present state, for the orientation nearest to it.

    Raises:
        ControllerError: If it is none of the task.
    """
    try:
        return _target_of(task, value, here)
    except TrajectoryError as error:  # of a value that a target would hold
        _, _, reason = error.bare_message.partition(": ")
        raise ControllerError(f"a target of task {task.name!r}: {reason}") from None


def _target_of(task: Task, value: object, here: Callable[[], RobotState]) -> Array:
    followed = task.followed
    if isinstance(task, Pointing):
        direction = numbers(value)
        if direction is not None and direction.shape == (3,):
            with np.errstate(over="ignore"):
                length = np.linalg.norm(direction)
            if not 0.0 < length < np.inf:
                raise ControllerError(
                    f"a target of task {task.name!r}: the direction is "
                    f"{direction.tolist()}; must be non-zero and finite"
                )
            return np.array(pin.Quaternion(task.facing(direction, here())).coeffs())
    if isinstance(followed, PoseTrajectory):
        needed = "a pin.SE3, x, y, z and a quaternion (x, y, z, w), or a 4 × 4 matrix"
        pose: Any = HoldPose.of_value(value)
        if pose is not None:
            there = pin.SE3(matrix_of(pose.rotation), pose.position)
            return np.asarray(pin.SE3ToXYZQUAT(there))
    elif isinstance(followed, OrientationTrajectory):
        needed = "a quaternion (x, y, z, w), a 3 × 3 matrix, or roll, pitch and yaw"
        turned: Any = HoldOrientation.of_value(value)
        if turned is not None:
            return np.array(pin.Quaternion(matrix_of(turned.rotation)).coeffs())
    else:
        assert followed is not None
        needed = f"{followed.dimension} numbers"
        point = Hold.of_value(value)
        if point is not None and point.dimension == followed.dimension:
            return np.asarray(point.point)
    given = shortened(repr(value).partition("\n")[0], 60)
    raise ControllerError(f"a target of task {task.name!r} is {needed}; got {given}")
