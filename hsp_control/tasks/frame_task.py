"""What tasks of one frame share: they follow, and one kernel writes the rows."""

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
    """A task of one frame: write `_compile`.

    Attributes:
        frame: The frame's name.
    """

    def __init__(
        self, robot: Robot, frame: str, rows: int, gains: Gains, name: str
    ) -> None:
        """Set the task; see its class.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            TaskError: If the task has more rows than the robot has freedoms.
            GainError: If the gains do not fit.
        """
        robot.frame_id(frame)
        super().__init__(robot, rows, gains, name)
        self.frame = frame

    @abstractmethod
    def _compile(
        self, frame: FrameKinematics, out: TaskSample
    ) -> tuple[Follower, Callable[[], Any]]:
        """Return what brings the reference up to a time, and what then writes ``out``.

        Called whenever another state's frame, or another sample, is to be used.
        """

    def _calls(self, state: RobotState, out: TaskSample) -> StepPlan:
        frame = state.frame(self.frame)
        follow, write = self._compile(frame, out)
        return StepPlan((follow,), (frame.compute, write))
