"""Trajectories of tasks, placed where the robot starts."""

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.declaration import within
from hsp_control.trajectories import (
    Blend,
    BlendOrientation,
    ComposedPose,
    OrientationTrajectory,
    PoseTrajectory,
    Trajectory,
)


def place_point(trajectory: Trajectory, here: Array, blend: float | None) -> Trajectory:
    """Return the trajectory of a point in the world, blended if asked for.

    Shapes: here (n,).
    """
    with within("trajectory"):
        placed = trajectory.anchored(here)
        if placed.dimension != len(here):
            raise TaskError(
                f"the trajectory has dimension {placed.dimension}; the task needs "
                f"{len(here)}"
            )
        return placed if blend is None else Blend(placed, blend, start=here)


def place_orientation(
    trajectory: OrientationTrajectory, here: Array, blend: float | None
) -> OrientationTrajectory:
    """Return the trajectory of an orientation, blended if asked for."""
    with within("trajectory"):
        placed = trajectory.anchored(here)
        if blend is None:
            return placed
        return BlendOrientation(placed, blend, rotation=here)


def place_pose(
    trajectory: PoseTrajectory | Trajectory, here: pin.SE3, blend: float | None
) -> PoseTrajectory:
    """Return the trajectory of a pose, blended if asked for."""
    if isinstance(trajectory, Trajectory):
        point = place_point(trajectory, np.array(here.translation), None)
        trajectory = ComposedPose(point)
    with within("trajectory"):
        placed = trajectory.anchored(here)
    if blend is None:
        return placed
    if not isinstance(placed, ComposedPose):
        with within("blend"):
            raise TaskError(
                f"{type(placed).__name__} begins where it says; remove blend"
            )
    return ComposedPose(
        place_point(placed.position, np.array(here.translation), blend),
        place_orientation(placed.orientation, np.array(here.rotation), blend),
    )
