"""World axes by their letters, and the kernel of a point tracked along them."""

import numpy as np

from hsp_control.common.arrays import Indices
from hsp_control.compiled.kernels import kernel
from hsp_control.law import TaskSample
from hsp_control.robot.inertia import PointMotion
from hsp_control.robot.kinematics import FrameMotion
from hsp_control.tasks.feedback import Feedback, add_feedback
from hsp_control.trajectories import TrajectorySample


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
