"""The task of a frame's pose relative to another frame, as for two hands on a part."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.rotations import quaternion_from_rotation
from hsp_control.common.step_plan import StepPlan
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameMotion
from hsp_control.tasks.frame_orientation import ORIENTATION_SCRATCH
from hsp_control.tasks.frame_pose import pose_error_equation
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import CompiledTask, TaskSample, default_name
from hsp_control.trajectories import PoseSample, PoseTrajectory


class RelativePose(CompiledTask):
    """e = (x_d - x, -log(R_dᵀ Q)), x = R_rᵀ(p - p_r), Q = R_rᵀ R [m, rad].

    The pose of a frame relative to a reference frame r, in the axes of r. Both errors
    are exactly linear; all else is as in `FramePose`.

    Attributes:
        frame: Name of the frame that is controlled.
        reference: Name of the frame in which the pose is measured.
        trajectory: The desired relative pose.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        reference: str,
        trajectory: PoseTrajectory,
        gains: Gains,
        *,
        name: str | None = None,
    ) -> None:
        """Set the task.

        Args:
            robot: The robot.
            frame: Name of the frame.
            reference: Name of the frame that the pose is measured in.
            trajectory: The desired pose, reference ← frame.
            gains: Feedback gains of the six rows, position before orientation.
            name: Name of the task in the log; ``<frame>_from_<reference>`` by default.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            TaskError: If the two frames are the same, or the robot has fewer than six
                degrees of freedom.
            GainError: If the gains do not fit the rows.
        """
        robot.frame_id(frame)
        robot.frame_id(reference)
        if frame == reference:
            raise TaskError(
                f"frame and reference are both {frame!r}; they must be different frames"
            )
        default = default_name(f"{frame}_from_{reference}")
        super().__init__(robot, 6, gains, name or default)
        self.frame = frame
        self.reference = reference
        self.trajectory = trajectory

    def _step_plan(self, state: RobotState, out: TaskSample) -> StepPlan:
        frame, reference = state.frame(self.frame), state.frame(self.reference)
        desired, relative = np.zeros((8, 3)), FrameMotion.allocate(self.robot.nv)
        relate = bind(
            _relative_kinematics, frame.motion, reference.motion, state.v, relative
        )
        write = bind(
            pose_error_equation,
            relative,
            desired,
            self.feedback,
            np.zeros((ORIENTATION_SCRATCH, 3)),
            out,
        )
        follow = self.trajectory.follow(PoseSample.over(desired))
        return StepPlan((follow,), (frame.compute, reference.compute, relate, write))

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' and w_d in the reference's axes, shape (6,) [m/s, rad/s]."""
        sample = self.trajectory.sample(state.t)
        return np.concatenate(
            [sample.position.velocity, sample.orientation.angular_velocity]
        )

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual pose: x, y, z [m], quaternion (x, y, z, w)."""
        sample, relative = self.trajectory.sample(state.t), self._relative(state)
        desired, actual = np.zeros(7), np.zeros(7)
        desired[:3], actual[:3] = sample.position.position, relative.position
        quaternion_from_rotation(sample.orientation.rotation, desired[3:])
        quaternion_from_rotation(relative.rotation, actual[3:])
        if desired[3:] @ actual[3:] < 0.0:
            actual[3:] *= -1.0
        return desired, actual

    def _relative(self, state: RobotState) -> FrameMotion:
        frame, reference = state.frame(self.frame), state.frame(self.reference)
        relative = FrameMotion.allocate(self.robot.nv)
        _relative_kinematics(frame.motion, reference.motion, state.v, relative)
        return relative


@kernel
def _relative_kinematics(
    frame: FrameMotion, reference: FrameMotion, v: Array, out: FrameMotion
) -> None:
    """Write the kinematics of frame f relative to frame r, in the axes of r.

    With d = p_f - p_r and K = J_f - J_r, whose linear rows also lose
    (angular rows of J_r) × d: J = R_rᵀ K. Since (R_rᵀ)' = -R_rᵀ[w_r]×,
    J' = R_rᵀ(K' - w_r × K).
    """
    J_f, J_f_dot, R_f, p_f, _ = frame
    J_r, J_r_dot, R_r, p_r, _ = reference
    J, J_dot, R, p, velocity = out
    n = v.shape[0]
    for i in range(3):
        p[i] = 0.0
        for k in range(3):
            p[i] += R_r[k, i] * (p_f[k] - p_r[k])
            R[i, k] = 0.0
            for s in range(3):
                R[i, k] += R_r[s, i] * R_f[s, k]
    dx, dy, dz = p_f[0] - p_r[0], p_f[1] - p_r[1], p_f[2] - p_r[2]
    ux = uy = uz = wx = wy = wz = 0.0
    for j in range(n):
        ux += (J_f[0, j] - J_r[0, j]) * v[j]
        uy += (J_f[1, j] - J_r[1, j]) * v[j]
        uz += (J_f[2, j] - J_r[2, j]) * v[j]
        wx += J_r[3, j] * v[j]
        wy += J_r[4, j] * v[j]
        wz += J_r[5, j] * v[j]
    for i in range(6):
        velocity[i] = 0.0
    for j in range(n):
        ax, ay, az = J_r[3, j], J_r[4, j], J_r[5, j]
        bx, by, bz = J_r_dot[3, j], J_r_dot[4, j], J_r_dot[5, j]
        kx = J_f[0, j] - J_r[0, j] - (ay * dz - az * dy)
        ky = J_f[1, j] - J_r[1, j] - (az * dx - ax * dz)
        kz = J_f[2, j] - J_r[2, j] - (ax * dy - ay * dx)
        lx = J_f_dot[0, j] - J_r_dot[0, j] - (by * dz - bz * dy) - (ay * uz - az * uy)
        ly = J_f_dot[1, j] - J_r_dot[1, j] - (bz * dx - bx * dz) - (az * ux - ax * uz)
        lz = J_f_dot[2, j] - J_r_dot[2, j] - (bx * dy - by * dx) - (ax * uy - ay * ux)
        gx, gy, gz = J_f[3, j] - ax, J_f[4, j] - ay, J_f[5, j] - az
        hx, hy, hz = J_f_dot[3, j] - bx, J_f_dot[4, j] - by, J_f_dot[5, j] - bz
        lx -= wy * kz - wz * ky
        ly -= wz * kx - wx * kz
        lz -= wx * ky - wy * kx
        hx -= wy * gz - wz * gy
        hy -= wz * gx - wx * gz
        hz -= wx * gy - wy * gx
        for i in range(3):
            J[i, j] = R_r[0, i] * kx + R_r[1, i] * ky + R_r[2, i] * kz
            J_dot[i, j] = R_r[0, i] * lx + R_r[1, i] * ly + R_r[2, i] * lz
            J[3 + i, j] = R_r[0, i] * gx + R_r[1, i] * gy + R_r[2, i] * gz
            J_dot[3 + i, j] = R_r[0, i] * hx + R_r[1, i] * hy + R_r[2, i] * hz
        for i in range(6):
            velocity[i] += J[i, j] * v[j]
