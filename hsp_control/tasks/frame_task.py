"""What tasks of one frame share: they follow, and one kernel writes the rows."""

from abc import abstractmethod
from collections.abc import Callable
from functools import partial
from typing import Any

from hsp_control.bound import Bound
from hsp_control.kinematics import FrameKinematics
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task, TaskSample
from hsp_control.trajectories.following import Follower


class FrameTask(Task):
    """A task of one frame: write `_bind`.

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
        self._bound: tuple[FrameKinematics, TaskSample] | None = None

    @abstractmethod
    def _bind(
        self, frame: FrameKinematics, out: TaskSample
    ) -> tuple[Follower, Callable[[], Any]]:
        """Return what brings the reference up to a time, and what then writes ``out``.

        Called whenever another state's frame, or another sample, is to be used.
        """

    def bind(self, state: RobotState, out: TaskSample) -> Bound:
        """Return what `evaluate` does; see `Task.bind`."""
        follow, write = self._bind(state.frame(self.frame), out)
        return Bound((follow,), (partial(state.frame, self.frame), write))

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return the rows of the frame; see `Task.evaluate`."""
        if out is None:
            out = TaskSample.allocate(self.rows, self.robot.nv)
        frame = state.frame(self.frame)
        bound = self._bound
        if bound is None or bound[0] is not frame or bound[1] is not out:
            self._bound = frame, out
            self._follow, self._write = self._bind(frame, out)
        self._follow(state.t)
        self._write()
        return out

    def __getstate__(self) -> dict[str, Any]:
        """Return all but what is bound to a state's memory."""
        kept = self.__dict__ | {"_bound": None}
        return {k: x for k, x in kept.items() if k not in ("_follow", "_write")}
