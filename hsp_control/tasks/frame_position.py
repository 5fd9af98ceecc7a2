"""The task of a frame's origin, along all world axes or some of them."""

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
from hsp_control.tasks.task import TaskSample, default_name
from hsp_control.trajectories import Trajectory, TrajectorySample
from hsp_control.trajectories.following import Follower


class FramePosition(FrameTask):
    """e = x_d - x, the position of a frame's origin in world axes [m].

    J are the linear rows of the frame's Jacobian in world axes;
    a_x = x_d'' + Kv e' + Kp e + offset.

    Attributes:
        frame: Name of the frame.
        axes: World axes that are tracked, such as ``"xyz"`` or ``"xy"``.
        trajectory: x_d(t).
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
            trajectory: x_d(t) along the tracked axes [m], of dimension ``len(axes)``.
            gains: Feedback gains of the rows.
            axes: World axes that are tracked, in the trajectory's order.
            name: Name of the task in the log; the frame's name by default.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            TaskError: If the axes are not distinct letters of "xyz", or the trajectory
                has another dimension.
            GainError: If the gains do not fit the rows.
        """
        letters, indices = "".join(axes), axis_indices(axes)
        super().__init__(robot, frame, len(letters), gains, name or default_name(frame))
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
            desired,
            self.feedback,
            out,
        )
        return self.trajectory.follow(desired), write

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d', shape (m,) [m/s]."""
        return self.trajectory.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return x_d and x along the tracked axes, shape (m,) each [m]."""
        desired = self.trajectory.sample(state.t)
        return desired.position, state.position(self.frame)[self._axes]
