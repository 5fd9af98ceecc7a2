"""The base class of tasks that track one frame."""

from abc import abstractmethod
from collections.abc import Callable
from typing import Any

from hsp_control.common.step_plan import StepPlan
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import CompiledTask, TaskSample
from hsp_control.trajectories.following import Follower


class FrameTask(CompiledTask):
    """J a + J'v = a_x for one frame, with a reference that a trajectory gives.

    A subclass implements `_compile`, `reference_rate` and `measure`. The frame's
    kinematics are in world axes at its origin, linear rows before angular rows
    (Pinocchio's LOCAL_WORLD_ALIGNED).

    Attributes:
        frame: Name of the frame.
    """

    def __init__(
        self, robot: Robot, frame: str, rows: int, gains: Gains, name: str
    ) -> None:
        """Check the arguments and store them.

        Args:
            robot: The robot.
            frame: Name of the frame.
            rows: Number of rows m.
            gains: Feedback gains of the m rows.
            name: Name of the task in the log.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            TaskError: If the task has more rows than the robot has degrees of freedom.
            GainError: If the gains do not fit the rows.
        """
        robot.frame_id(frame)
        super().__init__(robot, rows, gains, name)
        self.frame = frame

    @abstractmethod
    def _compile(
        self, frame: FrameKinematics, out: TaskSample
    ) -> tuple[Follower, Callable[[], Any]]:
        """Return two calls: one updates the reference, the other writes ``out``.

        Args:
            frame: The kinematics of the frame, computed before the second call.
            out: The sample that the second call writes.

        Returns:
            A function of time [s] that updates the reference, and a function without
            arguments that reads reference and frame and writes ``out``.
        """

    def _step_plan(self, state: RobotState, out: TaskSample) -> StepPlan:
        frame = state.frame(self.frame)
        follow, write = self._compile(frame, out)
        return StepPlan((follow,), (frame.compute, write))
