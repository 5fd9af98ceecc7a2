"""Build trajectories."""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError
from hsp_control.config.models import motion as s
from hsp_control.trajectories import (
    Circle,
    ComposedPose,
    Hold,
    HoldOrientation,
    Line,
    Lissajous,
    MinimumJerk,
    OrientationPath,
    OrientationTrajectory,
    PoseTrajectory,
    ScrewInterpolation,
    Spin,
    Spline,
    Stops,
    Trajectory,
    UniformLine,
)


def position_trajectory(model: s.PointTrajectory, start: Array | None) -> Trajectory:
    """Return the trajectory of a point.

    Args:
        model: Its configuration.
        start: The robot's start position, shape (n,); None if there is none.

    Raises:
        TrajectoryError: If its origin is a start that does not exist, a point has the
            wrong length, or the trajectory is not valid.
    """
    if model.origin == "start" and start is None:
        raise TrajectoryError("origin: start is not available here; use origin: world")
    origin = start if model.origin == "start" and start is not None else 0.0

    def point(values: Sequence[float] | Sequence[Sequence[float]] | None) -> Array:
        """Return the given points in the world, or the start if there are none."""
        if values is None and start is None:
            raise TrajectoryError(
                "the point is missing, and there is no start to use instead"
            )
        if values is None:
            return np.asarray(start)
        array = np.asarray(values, dtype=float)
        size = array.shape[-1]
        if start is not None and size != len(start):
            raise TrajectoryError(
                f"a point has {size} numbers {array.tolist()}; needs {len(start)}"
            )
        return np.asarray(array + origin)

    match model:
        case s.HoldModel():
            return Hold(point(model.point))
        case s.LineModel():
            return Line(
                point(model.start), point(model.end), model.duration, model.start_time
            )
        case s.UniformLineModel():
            return UniformLine(point(model.start), model.velocity)
        case s.CircleModel():
            return Circle(
                point(model.center),
                model.radius,
                model.angular_rate,
                model.phase,
                axes=model.axes,
                normal=model.normal,
            )
        case s.LissajousModel():
            return Lissajous(
                point(model.center), model.amplitudes, model.rates, model.phases
            )
        case s.StopsModel():
            return Stops(_points(model.waypoints, point), model.times)
        case s.MinimumJerkModel():
            return MinimumJerk(_points(model.waypoints, point), model.times)
        case s.SplineModel():
            return Spline(_points(model.waypoints, point), model.times, model.degree)


def orientation_trajectory(
    model: s.OrientationModel, start: Array
) -> OrientationTrajectory:
    """Return the trajectory of an orientation.

    Args:
        model: Its configuration.
        start: The robot's start orientation, shape (3, 3).
    """
    match model:
        case s.HoldOrientationModel():
            return HoldOrientation(_rotation(model.rpy, start))
        case s.SpinModel():
            return Spin(_rotation(model.rpy, start), model.axis, model.rate)
        case s.OrientationPathModel():
            return OrientationPath(
                [_rotation(rpy, start) for rpy in model.rpy], model.times
            )


def pose_trajectory(model: s.PoseModel, start: pin.SE3) -> PoseTrajectory:
    """Return the trajectory of a pose; ``start`` is the robot's start pose."""
    match model:
        case s.ComposedPoseModel():
            return ComposedPose(
                position_trajectory(model.position, start.translation),
                orientation_trajectory(model.orientation, start.rotation),
            )
        case s.ScrewModel():
            end = pin.SE3(
                _rotation(model.rpy, start.rotation), np.array(model.position)
            )
            return ScrewInterpolation(start, end, model.duration, model.start_time)


def _rotation(rpy: Sequence[float] | None, start: Array) -> Array:
    return np.array(start) if rpy is None else np.array(pin.rpy.rpyToMatrix(*rpy))


def _points(waypoints: Sequence[Sequence[float]], point) -> Array:  # type: ignore[no-untyped-def]
    sizes = {len(waypoint) for waypoint in waypoints}
    if len(sizes) > 1:
        raise TrajectoryError(
            f"waypoints have different lengths {sorted(sizes)}; need the same"
        )
    return np.array([point(waypoint) for waypoint in waypoints])
