"""A frame's origin follows a trajectory, along all world axes or some of them."""

from collections.abc import Sequence

import numpy as np

from hsp_control.arrays import Array, Indices
from hsp_control.exceptions import TaskError
from hsp_control.kernels import kernel
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task, TaskSample, named_after, track
from hsp_control.trajectories import Trajectory, TrajectorySample


class FramePosition(Task):
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
        robot.frame_id(frame)
        letters = "".join(axes)
        if not letters or len(set(letters)) < len(letters) or set(letters) - set("xyz"):
            raise TaskError(f"axes {letters!r}: name distinct axes among x, y and z")
        super().__init__(robot, len(letters), gains, name or named_after(frame))
        if trajectory.dimension != self.rows:
            raise TaskError(
                f"task {self.name!r} tracks the axes {letters!r}; its trajectory has "
                f"dimension {trajectory.dimension}, needs {self.rows}"
            )
        self.frame = frame
        self.axes = letters
        self.trajectory = trajectory
        self._axes = np.array(["xyz".index(a) for a in letters], dtype=np.int64)
        self._desired = TrajectorySample.allocate(self.rows)

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return the rows of the tracked axes; see `Task.evaluate`."""
        out = self._out(out)
        frame = state.frame(self.frame)
        desired = self.trajectory.sample(state.t, self._desired)
        _frame_position(
            self._axes,
            frame.jacobian,
            frame.jacobian_dot,
            frame.position,
            frame.velocity,
            *desired,
            self.Kp,
            self.Kv,
            *out,
        )
        return out

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' [m/s]."""
        return self.trajectory.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual position of the tracked axes [m]."""
        desired = self.trajectory.sample(state.t)
        return desired.position, state.position(self.frame)[self._axes]


@kernel
def _frame_position(
    axes: Indices,
    J_frame: Array,
    J_frame_dot: Array,
    position: Array,
    velocity: Array,
    x_d: Array,
    x_d_dot: Array,
    x_d_ddot: Array,
    Kp: Array,
    Kv: Array,
    J: Array,
    J_dot: Array,
    e: Array,
    e_dot: Array,
    a_x: Array,
) -> None:
    """Write the sample; a_x = x_d'' + Kv e' + Kp e."""
    for k in range(axes.shape[0]):
        i = axes[k]
        J[k, :] = J_frame[i, :]
        J_dot[k, :] = J_frame_dot[i, :]
        e[k] = x_d[k] - position[i]
        e_dot[k] = x_d_dot[k] - velocity[i]
    track(x_d_ddot, Kp, Kv, e, e_dot, a_x)
