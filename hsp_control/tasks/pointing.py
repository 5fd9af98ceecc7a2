"""An axis of a frame points along a direction that may move: a task on the sphere."""

from collections.abc import Sequence

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import TaskError
from hsp_control.kernels import kernel
from hsp_control.robot import Robot, RobotState
from hsp_control.rotations import cross, rotate, rotate_back
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task, TaskSample, track
from hsp_control.trajectories import OrientationSample, OrientationTrajectory

NEAREST_TO_ANTIPODE = 0.02
"""Below this 1 + cos(angle) the coordinates are held from blowing up (168 degrees)."""


class Pointing(Task):
    """Pointing axis: two rows, the turn about the axis itself is free.

    The error is e = -(n_x, n_y)/(1 + n_z), the stereographic coordinates of the axis
    n seen from the desired direction: |e| = tan(angle/2). In them the error equation is
    exact up to the antipode (law.md §1); within 12 degrees of it they are held bounded
    and the equation no longer holds.

    Attributes:
        frame: The frame's name.
        axis: The pointing axis in the frame, a unit vector.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        axis: Sequence[float],
        trajectory: OrientationTrajectory,
        gains: Gains,
        *,
        name: str | None = None,
    ) -> None:
        """Set the task.

        Args:
            robot: The robot.
            frame: Name of the frame.
            axis: Pointing axis in the frame, shape (3,); normalised here.
            trajectory: An orientation whose third axis is the desired direction.
            gains: Feedback gains of the two rows.
            name: What the log calls it; ``<frame>_pointing`` by default.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            TaskError: If the axis has no direction.
            GainError: If the gains do not fit.
        """
        robot.frame_id(frame)
        super().__init__(robot, 2, gains, name or f"{frame}_pointing")
        vector = np.asarray(axis, dtype=float)
        if vector.shape != (3,) or not 0.0 < np.linalg.norm(vector) < np.inf:
            raise TaskError(f"axis {list(axis)} is not a direction: needs 3 numbers")
        self.frame = frame
        self.axis: Array = vector / np.linalg.norm(vector)
        self.trajectory = trajectory
        # Two directions across the axis, right-handed with it: the rows of the task.
        across = np.linalg.svd(self.axis[None, :])[2][1:]
        across[1] *= np.sign(np.linalg.det(np.vstack([across, self.axis])))
        self._across = across.copy()
        self._desired = OrientationSample.allocate()
        self._scratch = np.zeros((12, 3))

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return the two angular rows across the axis; see `Task.evaluate`."""
        out = self._out(out)
        frame = state.frame(self.frame)
        desired = self.trajectory.sample(state.t, self._desired)
        _pointing(
            self.axis,
            self._across,
            frame.jacobian,
            frame.jacobian_dot,
            frame.rotation,
            frame.velocity[3:],
            *desired,
            self.Kp,
            self.Kv,
            self._scratch,
            *out,
        )
        return out

    def reference_rate(self, state: RobotState) -> Array:
        """Return the components of w_d across the axis [rad/s]."""
        w_d = self.trajectory.sample(state.t).angular_velocity
        return self._across @ state.frame(self.frame).rotation.T @ w_d

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual direction in the world, unit vectors."""
        desired = self.trajectory.sample(state.t).rotation[:, 2].copy()
        return desired, state.frame(self.frame).rotation @ self.axis


@kernel
def _pointing(
    axis: Array,
    across: Array,
    J_frame: Array,
    J_frame_dot: Array,
    R: Array,
    w: Array,
    R_d: Array,
    w_d: Array,
    w_d_dot: Array,
    Kp: Array,
    Kv: Array,
    scratch: Array,
    J: Array,
    J_dot: Array,
    e: Array,
    e_dot: Array,
    a_x: Array,
) -> None:
    """Write the sample.

    With m the axis in the world and n = R_dᵀ m: n' = R_dᵀ((w - w_d) × m), and y'' is
    linear in the two components of w' across the axis.
    """
    m, c0, c1 = scratch[0], scratch[1], scratch[2]
    w_rel, m_rel, n, n_dot, rest, turn, moved = (
        scratch[3],
        scratch[4],
        scratch[5],
        scratch[6],
        scratch[7],
        scratch[8],
        scratch[9],
    )
    rotate(R, axis, m)
    rotate(R, across[0], c0)
    rotate(R, across[1], c1)

    # The rows and their rates: J = cᵀ J_w, J' = cᵀ J_w' + (w × c)ᵀ J_w.
    for k in range(2):
        c = c0 if k == 0 else c1
        cross(w, c, turn)
        for j in range(J.shape[1]):
            J[k, j] = 0.0
            J_dot[k, j] = 0.0
            for i in range(3):
                J[k, j] += c[i] * J_frame[3 + i, j]
                J_dot[k, j] += c[i] * J_frame_dot[3 + i, j]
                J_dot[k, j] += turn[i] * J_frame[3 + i, j]

    # n, n' and the part of n'' that no choice of w' changes.
    for i in range(3):
        w_rel[i] = w[i] - w_d[i]
    cross(w_rel, m, m_rel)
    rotate_back(R_d, m, n)
    rotate_back(R_d, m_rel, n_dot)
    cross(w, m, turn)
    cross(w_rel, turn, moved)
    cross(w_d, m_rel, turn)
    for i in range(3):
        moved[i] -= turn[i]
    cross(w_d_dot, m, turn)
    for i in range(3):
        moved[i] -= turn[i]
    rotate_back(R_d, moved, rest)

    # y = (n_x, n_y)/s and its rates, s = 1 + n_z.
    s = max(1.0 + n[2], NEAREST_TO_ANTIPODE)
    s_dot = n_dot[2]
    for k in range(2):
        e[k] = -n[k] / s
        e_dot[k] = -(n_dot[k] - n[k] * s_dot / s) / s
    y_ddot, zero = scratch[10, :2], scratch[11, :2]
    zero[0] = zero[1] = 0.0
    track(zero, Kp, Kv, e, e_dot, y_ddot)  # y'' = -e'' = Kv e' + Kp e

    # y'' = D w' + (the rest); a turn about c0 moves m along -c1, one about c1 along c0.
    for k in range(2):
        y_ddot[k] -= (rest[k] - n[k] * rest[2] / s) / s
        y_ddot[k] -= 2.0 * s_dot * e_dot[k] / s
    rotate_back(R_d, c1, turn)
    rotate_back(R_d, c0, moved)
    d00, d10 = -(turn[0] - n[0] * turn[2] / s) / s, -(turn[1] - n[1] * turn[2] / s) / s
    d01, d11 = (
        (moved[0] - n[0] * moved[2] / s) / s,
        (moved[1] - n[1] * moved[2] / s) / s,
    )
    det = d00 * d11 - d01 * d10
    if det == 0.0:
        a_x[0] = a_x[1] = 0.0
        return
    a_x[0] = (d11 * y_ddot[0] - d01 * y_ddot[1]) / det
    a_x[1] = (d00 * y_ddot[1] - d10 * y_ddot[0]) / det
