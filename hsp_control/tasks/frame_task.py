"""Base classes of tasks that follow a trajectory, or track a frame."""

from abc import abstractmethod
from dataclasses import KW_ONLY, replace
from typing import Any, Self

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import TaskError
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Positive
from hsp_control.geometry.scene import Start
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks.task import SecondOrderTask, default_name
from hsp_control.trajectories import (
    Blend,
    BlendOrientation,
    ComposedPose,
    OrientationTrajectory,
    PoseTrajectory,
    Trajectory,
)


def place_point(trajectory: Trajectory, here: Array, blend: float | None) -> Trajectory:
    """Return the trajectory of a point in the world, blended if requested."""
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
    """Return the trajectory of an orientation, blended if requested."""
    with within("trajectory"):
        placed = trajectory.anchored(here)
        if blend is None:
            return placed
        return BlendOrientation(placed, blend, rotation=here)


def place_pose(
    trajectory: PoseTrajectory | Trajectory, here: pin.SE3, blend: float | None
) -> PoseTrajectory:
    """Return the trajectory of a pose, blended if requested."""
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
                f"{type(placed).__name__} has its own beginning; remove blend"
            )
    return ComposedPose(
        place_point(placed.position, np.array(here.translation), blend),
        place_orientation(placed.orientation, np.array(here.rotation), blend),
    )


class TrackingTask(SecondOrderTask):
    """A task that follows a trajectory, into which it may be blended at the start."""

    _: KW_ONLY
    blend: Positive | None = None
    """Duration of the transition from the robot's start to the trajectory [s]; none by
    default."""

    def _reference_at(self, state: RobotState) -> Any:
        """Return the reference at the state's time; the state stores the sample."""

        def make() -> tuple[Any, Any]:
            followed: Any = self.followed
            sample = followed.sample(state.t)
            return sample, followed.calls(sample)

        sample, follow = state.prepared(self, "reference", make)
        follow()
        return sample


class FrameTask(SecondOrderTask):
    """J a + J'v = a_x for one frame, with a trajectory as reference.

    Its kinematics are in world axes at its origin, linear rows before angular rows
    (Pinocchio's LOCAL_WORLD_ALIGNED).
    """

    frame: str | None = None
    """Name of the frame [-]; the robot's end effector by default."""

    @property
    def frame_name(self) -> str:
        """Name of the frame of a placed task."""
        if self.frame is None:
            raise self._not_placed("frame")
        return self.frame

    def _default_name(self) -> str:
        return default_name(self.frame or "end_effector")

    def placed(self, start: Start) -> Self:
        """Return the task with its trajectory in the world; see `Task.placed`."""
        robot = start.state.robot
        frame = frame_of(self.frame, robot)
        changes = self._placed_at(start.state.frame(frame))
        return replace(self, frame=frame, **changes).checked(robot)

    @abstractmethod
    def _placed_at(self, here: FrameKinematics) -> dict[str, Any]:
        """Return the fields to replace for the frame's start."""

    def keeps_balance(self, robot: Robot) -> bool:
        """Whether the frame belongs to the trunk; see `Robot.is_on_trunk`."""
        return robot.is_on_trunk(self.frame_name)


def frame_of(frame: str | None, robot: Robot) -> str:
    """Return the frame, checked to exist, or the robot's end effector."""
    if frame is None:
        return robot.end_effector
    with within("frame"):
        robot.frame_id(frame)
    return frame
