"""A frame's orientation follows a trajectory on SO(3), with an exactly linear error."""

import numpy as np

from hsp_control.arrays import Array
from hsp_control.kernels import kernel
from hsp_control.linalg import multiply
from hsp_control.robot import Robot, RobotState
from hsp_control.rotations import (
    compose_back,
    cross,
    jexp3,
    jexp3_dot,
    jlog3,
    log3,
    quaternion_from_rotation,
    rotate,
    rotate_back,
)
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task, TaskSample, named_after, track
from hsp_control.trajectories import OrientationSample, OrientationTrajectory


class FrameOrientation(Task):
    """Orientation of a frame in the world.

    The error is e = -log(R_dᵀ R), in the desired frame: rotation vector [rad], exact up
    to an angle of pi (law.md §1). At pi the shortest way back changes side: the error
    jumps from e to -e, and everything stays finite.

    Attributes:
        frame: The frame's name.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        trajectory: OrientationTrajectory,
        gains: Gains,
        *,
        name: str | None = None,
    ) -> None:
        """Set the task.

        Args:
            robot: The robot.
            frame: Name of the frame.
            trajectory: R_d(t), world ← frame.
            gains: Feedback gains.
            name: What the log calls it; ``<frame>_orientation`` by default.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            TaskError: If the robot has fewer than three freedoms.
            GainError: If the gains do not fit.
        """
        robot.frame_id(frame)
        super().__init__(robot, 3, gains, name or f"{named_after(frame)}_orientation")
        self.frame = frame
        self.trajectory = trajectory
        self._desired = OrientationSample.allocate()
        self._scratch = np.zeros((8, 3))
        self._matrices = np.zeros((3, 3, 3))

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return the three angular rows; see `Task.evaluate`."""
        out = self._out(out)
        frame = state.frame(self.frame)
        desired = self.trajectory.sample(state.t, self._desired)
        out.jacobian[:] = frame.jacobian[3:]
        out.jacobian_dot[:] = frame.jacobian_dot[3:]
        track_orientation(
            frame.rotation,
            frame.velocity[3:],
            *desired,
            self.Kp,
            self.Kv,
            self._scratch,
            self._matrices,
            out.error,
            out.error_rate,
            out.acceleration,
        )
        return out

    def reference_rate(self, state: RobotState) -> Array:
        """Return w_d [rad/s]."""
        return self.trajectory.sample(state.t).angular_velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual orientation as quaternions (x, y, z, w)."""
        desired, actual = np.zeros(4), np.zeros(4)
        quaternion_from_rotation(self.trajectory.sample(state.t).rotation, desired)
        quaternion_from_rotation(state.frame(self.frame).rotation, actual)
        # Of the two quaternions of one rotation, the one that plots beside the other.
        return desired, actual if desired @ actual >= 0.0 else -actual


@kernel
def orientation_error(
    R: Array,
    w: Array,
    R_d: Array,
    w_d: Array,
    scratch: Array,
    matrices: Array,
    e: Array,
    e_dot: Array,
) -> None:
    """Write e = -y and e' = -y' with y = log(R_dᵀ R) and y' = Jlog(y) w̃.

    Args:
        R: World ← frame, shape (3, 3).
        w: Angular velocity, world axes, shape (3,).
        R_d: Desired orientation, shape (3, 3).
        w_d: Desired angular velocity, world axes, shape (3,).
        scratch: Shape (≥ 2, 3).
        matrices: Shape (≥ 1, 3, 3).
        e: Error, shape (3,).
        e_dot: Its rate, shape (3,).
    """
    E, w_tilde, y = matrices[0], scratch[0], scratch[1]
    compose_back(R_d, R, E)
    log3(E, y)
    for i in range(3):
        e[i] = w[i] - w_d[i]
    rotate_back(R, e, w_tilde)
    jlog3(y, E)
    multiply(E, w_tilde, e_dot)
    for i in range(3):
        e[i] = -y[i]
        e_dot[i] = -e_dot[i]


@kernel
def orientation_acceleration(
    R: Array,
    w: Array,
    w_d: Array,
    w_d_dot: Array,
    e: Array,
    e_dot: Array,
    e_ddot: Array,
    scratch: Array,
    matrices: Array,
    out: Array,
) -> None:
    """Write the angular acceleration, world axes, that gives the error e'' as asked.

    w̃ = Jexp(y) y' gives w̃' = Jexp y'' + Jexp' y'; the desired frame's own motion adds
    the transport term: w' = R w̃' - w × w_d + w_d'.
    """
    y, y_dot, y_ddot, turned, bent = (
        scratch[0],
        scratch[1],
        scratch[2],
        scratch[3],
        scratch[4],
    )
    for i in range(3):
        y[i], y_dot[i], y_ddot[i] = -e[i], -e_dot[i], -e_ddot[i]
    jexp3(y, matrices[0])
    jexp3_dot(y, y_dot, matrices[1])
    multiply(matrices[0], y_ddot, turned)
    multiply(matrices[1], y_dot, bent)
    for i in range(3):
        turned[i] += bent[i]
    rotate(R, turned, out)
    cross(w, w_d, bent)
    for i in range(3):
        out[i] += w_d_dot[i] - bent[i]


@kernel
def track_orientation(
    R: Array,
    w: Array,
    R_d: Array,
    w_d: Array,
    w_d_dot: Array,
    Kp: Array,
    Kv: Array,
    scratch: Array,
    matrices: Array,
    e: Array,
    e_dot: Array,
    a_x: Array,
) -> None:
    """Write e, e' and the angular acceleration for which e'' = -Kv e' - Kp e."""
    orientation_error(R, w, R_d, w_d, scratch, matrices, e, e_dot)
    wanted, zero = scratch[6], scratch[7]
    for i in range(3):
        zero[i] = 0.0
    track(zero, Kp, Kv, e, e_dot, wanted)
    for i in range(3):
        wanted[i] = -wanted[i]
    orientation_acceleration(
        R, w, w_d, w_d_dot, e, e_dot, wanted, scratch, matrices, a_x
    )
