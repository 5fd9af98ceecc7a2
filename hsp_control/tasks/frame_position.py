"""The task of a frame's origin, along all world axes or some of them."""

from dataclasses import KW_ONLY
from typing import Any, ClassVar

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.declaration.quantities import Axes
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import FrameKinematics, FrameMotion, PointMotion
from hsp_control.tasks.compliant_task import CompliantTask
from hsp_control.tasks.feedback import ErrorPart, Feedback, add_feedback
from hsp_control.tasks.frame_task import FrameTask, TrackingTask, place_point
from hsp_control.tasks.task import Drawn
from hsp_control.trajectories import Hold, Trajectory, TrajectorySample


class FramePosition(FrameTask, TrackingTask, CompliantTask, type="frame_position"):
    """e = x_d - x, the position of a frame's origin in world axes [m].

    J are the linear rows of the frame's Jacobian in world axes;
    a_x = x_d'' + Kv e' + Kp e + offset.
    """

    drawn: ClassVar[tuple[Drawn, ...]] = ("position",)
    wrench_unit: ClassVar[str | None] = "N"

    trajectory: Trajectory = Hold()
    """x_d(t), the trajectory of the origin [m]; held at the start by default."""
    _: KW_ONLY
    axes: Axes = "xyz"
    """World axes that are tracked, in the trajectory's order, such as ``xy`` [-]."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The position along the tracked axes."""
        return (ErrorPart("position", "m", "m/s", len(self.axes)),)

    def _placed_at(self, here: FrameKinematics) -> dict[str, Any]:
        begin = here.position[axis_indices(self.axes)]
        trajectory = place_point(self.trajectory, begin, self.blend)
        return {"trajectory": trajectory, "blend": None}

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel; see `Task.kernel`."""
        frame = state.frame(self.frame_name)
        return track_axes, (axis_indices(self.axes), frame, self.trajectory)

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d', shape (m,) [m/s]."""
        velocity: Array = self._reference_at(state).velocity.copy()
        return velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return x_d and x along the tracked axes, shape (m,) each [m]."""
        desired = self._reference_at(state).position.copy()
        return desired, state.position(self.frame_name)[axis_indices(self.axes)]


def axis_indices(axes: str) -> Indices:
    """Return the indices of axes: [0, 2] for ``"xz"``."""
    return np.array(["xyz".index(letter) for letter in axes], dtype=np.int64)


@kernel
def track_axes(
    axes: Indices,
    point: FrameMotion | PointMotion,
    desired: TrajectorySample,
    feedback: Feedback,
    out: TaskSample,
) -> None:
    """Write the sample of a point, whose motion is in world axes."""
    J_point, J_point_dot = point.jacobian, point.jacobian_dot
    position, velocity = point.position, point.velocity
    x_d, x_d_dot, x_d_ddot = desired
    J, J_dot, e, e_dot, a_x = out
    for k in range(axes.shape[0]):
        i = axes[k]
        for j in range(J.shape[1]):
            J[k, j] = J_point[i, j]
            J_dot[k, j] = J_point_dot[i, j]
        e[k] = x_d[k] - position[i]
        e_dot[k] = x_d_dot[k] - velocity[i]
    add_feedback(x_d_ddot, feedback, e, e_dot, a_x)
