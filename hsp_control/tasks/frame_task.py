"""The base classes of tasks that follow a trajectory, or that track a frame."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY
from typing import Any

from hsp_control.common.step_plan import StepPlan
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Positive
from hsp_control.law import TaskSample
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks.task import Feedback, SecondOrderTask, default_name
from hsp_control.trajectories.following import Follower


class TrackingTask(SecondOrderTask):
    """A task that follows a trajectory, into which it may be blended at the start."""

    _: KW_ONLY
    blend: Positive | None = None
    """Duration of the transition from where the robot starts to the trajectory [s];
    none by default."""


class FrameTask(SecondOrderTask):
    """J a + J'v = a_x for one frame, with a reference that a trajectory gives.

    A subclass implements `_compile`, `reference_rate` and `measure`. The frame's
    kinematics are in world axes at its origin, linear rows before angular rows
    (Pinocchio's LOCAL_WORLD_ALIGNED).
    """

    frame: str | None = None
    """Name of the frame [-]; the robot's end effector by default."""

    @property
    def frame_name(self) -> str:
        """Name of the frame of a placed task.

        Raises:
            TaskError: If the task is not placed.
        """
        if self.frame is None:
            raise self._not_placed("frame")
        return self.frame

    def _default_name(self) -> str:
        return default_name(self.frame or "end_effector")

    @abstractmethod
    def _compile(
        self, frame: FrameKinematics, feedback: Feedback, out: TaskSample
    ) -> tuple[Follower, Callable[[], Any]]:
        """Return what updates the reference at a time [s], and what writes ``out``."""

    def compile(
        self, state: RobotState, feedback: Feedback, out: TaskSample
    ) -> StepPlan:
        """Return the step plan; see `Task.compile`."""
        frame = state.frame(self.frame_name)
        follow, write = self._compile(frame, feedback, out)
        return StepPlan((follow,), (frame.compute, write))

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
