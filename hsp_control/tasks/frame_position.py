"""A frame's origin follows a trajectory, along all world axes or some of them."""

from collections.abc import Callable, Sequence
from typing import Any

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.common.native import bind
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks.axes import axis_indices, track_axes
from hsp_control.tasks.frame_task import FrameTask
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import TaskSample, named_after
from hsp_control.trajectories import Trajectory, TrajectorySample
from hsp_control.trajectories.following import Follower


class FramePosition(FrameTask):
    """Position of a frame's origin in the world: e = x_d - x, exactly linear.

    Attributes:
        frame: The frame's name.
        axes: World axes that are tracked, such as ``"xyz"`` or ``"xy"``.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        trajectory: Trajectory,
        gains: Gains,
        *,
        axes: str | Sequence[str] = "xyz",
        name: str | None = None,
    ) -> None:
        """Set the task.

        Args:
            robot: The robot.
            frame: Name of the frame.
            trajectory: x_d(t) of the tracked axes [m], of dimension ``len(axes)``.
            gains: Feedback gains.
            axes: World axes that are tracked, in the trajectory's order.
            name: What the log calls it; the frame's name by default.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            TaskError: If the axes are not distinct letters of "xyz", or the trajectory
                has another dimension.
            GainError: If the gains do not fit.
        """
        letters, indices = "".join(axes), axis_indices(axes)
        super().__init__(robot, frame, len(letters), gains, name or named_after(frame))
        if trajectory.dimension != self.rows:
            raise TaskError(
                f"task {self.name!r} tracks the axes {letters!r}; its trajectory has "
                f"dimension {trajectory.dimension}, needs {self.rows}"
            )
        self.axes = letters
        self.trajectory = trajectory
        self._axes = indices

    def _compile(
        self, frame: FrameKinematics, out: TaskSample
    ) -> tuple[Follower, Callable[[], Any]]:
        desired = TrajectorySample.allocate(self.rows)
        write = bind(
            track_axes,
            self._axes,
            frame.jacobian,
            frame.jacobian_dot,
            frame.position,
            frame.velocity,
            *desired,
            self.Kp,
            self.Kv,
            self.offset,
            *out,
        )
        return self.trajectory.follow(desired), write

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' [m/s]."""
        return self.trajectory.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual position of the tracked axes [m]."""
        desired = self.trajectory.sample(state.t)
        return desired.position, state.position(self.frame)[self._axes]
