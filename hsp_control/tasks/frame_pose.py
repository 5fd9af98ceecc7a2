"""The task of a frame's pose: its origin and its orientation together."""

from collections.abc import Callable
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.rotations import quaternion_from_rotation
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameKinematics, FrameMotion
from hsp_control.tasks.frame_orientation import (
    ORIENTATION_SCRATCH,
    orientation_acceleration,
    orientation_error,
)
from hsp_control.tasks.frame_task import FrameTask
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import (
    Feedback,
    TaskSample,
    add_feedback,
    copy_rows,
    default_name,
)
from hsp_control.trajectories import PoseSample, PoseTrajectory
from hsp_control.trajectories.following import Follower


class FramePose(FrameTask):
    """e = (x_d - x, -log(R_dᵀ R)), the pose of a frame in the world [m, rad].

    Position rows are in world axes; orientation rows are those of `FrameOrientation`.
    The two errors are decoupled and exactly linear, and the origin returns on a
    straight line. With the logarithm on SE(3) it would return on a screw
    (docs/law.md).

    Attributes:
        frame: Name of the frame.
        trajectory: The desired pose.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        trajectory: PoseTrajectory,
        gains: Gains,
        *,
        name: str | None = None,
    ) -> None:
        """Set the task.

        Args:
            robot: The robot.
            frame: Name of the frame.
            trajectory: The desired pose, world ← frame.
            gains: Feedback gains of the six rows, position before orientation.
            name: Name of the task in the log; the frame's name by default.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            TaskError: If the robot has fewer than six degrees of freedom.
            GainError: If the gains do not fit the rows.
        """
        super().__init__(robot, frame, 6, gains, name or default_name(frame))
        self.trajectory = trajectory

    def _compile(
        self, frame: FrameKinematics, out: TaskSample
    ) -> tuple[Follower, Callable[[], Any]]:
        desired = np.zeros((8, 3))
        write = bind(
            pose_error_equation,
            frame.motion,
            desired,
            self.feedback,
            np.zeros((ORIENTATION_SCRATCH, 3)),
            out,
        )
        return self.trajectory.follow(PoseSample.over(desired)), write

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' and w_d in world axes, shape (6,) [m/s, rad/s]."""
        sample = self.trajectory.sample(state.t)
        velocity, turning = (
            sample.position.velocity,
            sample.orientation.angular_velocity,
        )
        return np.concatenate([velocity, turning])

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual pose: x, y, z [m], quaternion (x, y, z, w)."""
        frame = state.frame(self.frame)
        sample = self.trajectory.sample(state.t)
        desired, actual = np.zeros(7), np.zeros(7)
        desired[:3], actual[:3] = sample.position.position, frame.position
        quaternion_from_rotation(sample.orientation.rotation, desired[3:])
        quaternion_from_rotation(frame.rotation, actual[3:])
        if desired[3:] @ actual[3:] < 0.0:
            actual[3:] *= -1.0
        return desired, actual


@kernel
def pose_error_equation(
    frame: FrameMotion,
    desired: Array,
    feedback: Feedback,
    scratch: Array,
    out: TaskSample,
) -> None:
    """Write the sample of a pose task; gains may couple position and orientation.

    ``desired`` has shape (8, 3): x, x', x'', R (three rows), ω, ω', see
    `PoseSample.over`.
    """
    J_frame, J_frame_dot, R, position, velocity = frame
    J, J_dot, e, e_dot, a_x = out
    copy_rows(J_frame, J_frame_dot, 0, J, J_dot)
    for i in range(3):
        e[i] = desired[0, i] - position[i]
        e_dot[i] = desired[1, i] - velocity[i]
        a_x[i] = desired[2, i]
        a_x[3 + i] = 0.0
    R_d, w_d, w_d_dot = desired[3:6], desired[6], desired[7]
    w, angle, angle_dot, turning = velocity[3:], e[3:], e_dot[3:], a_x[3:]
    orientation_error(R, w, R_d, w_d, scratch, angle, angle_dot)
    add_feedback(a_x, feedback, e, e_dot, a_x)
    orientation_acceleration(R, w, w_d, w_d_dot, angle, angle_dot, scratch, turning)
