"""The task of a frame's pose relative to another frame, as for two hands on a part."""

from dataclasses import KW_ONLY, replace
from typing import Self

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.compiled.kernels import KernelCall, KernelOutput, kernel
from hsp_control.declaration import within
from hsp_control.geometry.scene import Start
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import FrameMotion
from hsp_control.tasks.frame_pose import (
    ORIENTATION_SCRATCH,
    PoseOrPoint,
    PoseTask,
    track_pose,
)
from hsp_control.tasks.frame_task import frame_of, place_pose
from hsp_control.tasks.task import default_name
from hsp_control.trajectories import ComposedPose


class RelativePose(PoseTask, type="relative_pose"):
    """e = (x_d - x, -log(R_dᵀ Q)), x = R_rᵀ(p - p_r), Q = R_rᵀ R [m, rad].

    The pose of a frame relative to a reference frame r, in the axes of r. Both errors
    are exactly linear; all else is as in `FramePose`.
    """

    frame: str | None = None
    """Name of the frame that is controlled [-]; the robot's end effector by default."""
    trajectory: PoseOrPoint = ComposedPose()
    """The desired pose, reference ← frame, or the trajectory of its origin, with the
    relative orientation of the start [m, rad]; held at the start by default."""
    _: KW_ONLY
    reference: str
    """Name of the frame that the pose is relative to [-]."""

    def _default_name(self) -> str:
        return default_name(f"{self.frame or 'end_effector'}_from_{self.reference}")

    @property
    def frame_name(self) -> str:
        """Name of the frame of a placed task."""
        if self.frame is None:
            raise self._not_placed("frame")
        return self.frame

    def placed(self, start: Start) -> Self:
        """Return the task with its trajectory in the reference; see `Task.placed`."""
        robot: Robot = start.state.robot
        frame = frame_of(self.frame, robot)
        with within("reference"):
            robot.frame_id(self.reference)
            if frame == self.reference:
                raise TaskError(
                    f"frame and reference are both {frame!r}; they must be different "
                    "frames"
                )
        poses = [start.state.frame(name) for name in (self.reference, frame)]
        there, here = (pin.SE3(pose.rotation, pose.position) for pose in poses)
        trajectory = place_pose(self.trajectory, there.actInv(here), self.blend)
        placed = replace(self, frame=frame, trajectory=trajectory, blend=None)
        return placed.checked(robot)

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel; see `Task.kernel`."""
        frames = state.frame(self.frame_name), state.frame(self.reference)
        motion = FrameMotion.allocate(state.robot.nv)
        relative = KernelOutput((_relative_kinematics, (*frames, state.v)), motion)
        return track_pose, (relative, self.followed, np.zeros((ORIENTATION_SCRATCH, 3)))

    def actual(self, state: RobotState) -> tuple[Array, Array]:
        """Return position and rotation of the frame in the reference."""
        frame, reference = state.frame(self.frame_name), state.frame(self.reference)
        relative = FrameMotion.allocate(state.robot.nv)
        _relative_kinematics(frame.motion, reference.motion, state.v, relative)
        return relative.position, relative.rotation


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
