"""A frame follows a trajectory in space: its origin and its orientation together."""

import numpy as np

from hsp_control.arrays import Array
from hsp_control.kernels import kernel
from hsp_control.robot import Robot, RobotState
from hsp_control.rotations import quaternion_from_rotation
from hsp_control.tasks.frame_orientation import (
    orientation_acceleration,
    orientation_error,
)
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task, TaskSample, named_after, track
from hsp_control.trajectories import PoseSample, PoseTrajectory


class FramePose(Task):
    """Pose of a frame: the origin in the world [m], then -log(R_dᵀ R) [rad].

    Position in world axes beside orientation keeps both errors decoupled and exactly
    linear, and the origin's way home straight; the logarithm on SE(3) would make it a
    screw (law.md §1).

    Attributes:
        frame: The frame's name.
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
            trajectory: The desired pose in the world.
            gains: Feedback gains of the six rows.
            name: What the log calls it; the frame's name by default.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            TaskError: If the robot has fewer than six freedoms.
            GainError: If the gains do not fit.
        """
        robot.frame_id(frame)
        super().__init__(robot, 6, gains, name or named_after(frame))
        self.frame = frame
        self.trajectory = trajectory
        self._desired = PoseSample.allocate()
        self._scratch = np.zeros((8, 3))
        self._matrices = np.zeros((3, 3, 3))
        self._wanted = np.zeros(6)

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return the six rows; see `Task.evaluate`."""
        out = self._out(out)
        frame = state.frame(self.frame)
        desired = self.trajectory.sample(state.t, self._desired)
        pose_error_equation(
            frame.jacobian,
            frame.jacobian_dot,
            frame.rotation,
            frame.position,
            frame.velocity,
            *desired.position,
            *desired.orientation,
            self.Kp,
            self.Kv,
            self._wanted,
            self._scratch,
            self._matrices,
            *out,
        )
        return out

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' and w_d [m/s, rad/s]."""
        sample = self.trajectory.sample(state.t)
        velocity, turning = (
            sample.position.velocity,
            sample.orientation.angular_velocity,
        )
        return np.concatenate([velocity, turning])

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual (x, y, z, quaternion x, y, z, w)."""
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
    J_frame: Array,
    J_frame_dot: Array,
    R: Array,
    position: Array,
    velocity: Array,
    x_d: Array,
    x_d_dot: Array,
    x_d_ddot: Array,
    R_d: Array,
    w_d: Array,
    w_d_dot: Array,
    Kp: Array,
    Kv: Array,
    wanted: Array,
    scratch: Array,
    matrices: Array,
    J: Array,
    J_dot: Array,
    e: Array,
    e_dot: Array,
    a_x: Array,
) -> None:
    """Write the sample; the gains may couple position and orientation."""
    J[:, :] = J_frame
    J_dot[:, :] = J_frame_dot
    for i in range(3):
        e[i] = x_d[i] - position[i]
        e_dot[i] = x_d_dot[i] - velocity[i]
        wanted[i] = x_d_ddot[i]
        wanted[3 + i] = 0.0
    w = velocity[3:]
    orientation_error(R, w, R_d, w_d, scratch, matrices, e[3:], e_dot[3:])
    track(wanted, Kp, Kv, e, e_dot, a_x)
    for i in range(3):
        wanted[3 + i] = -a_x[3 + i]
    orientation_acceleration(
        R, w, w_d, w_d_dot, e[3:], e_dot[3:], wanted[3:], scratch, matrices, a_x[3:]
    )
