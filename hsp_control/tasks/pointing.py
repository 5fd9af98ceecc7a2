"""The task of an axis of a frame that points along a direction, which may move."""

from dataclasses import KW_ONLY, replace
from functools import cached_property
from math import sqrt
from typing import Any, ClassVar, Self

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.compiled.rotations import cross, rotate, rotate_back
from hsp_control.declaration.quantities import Vector3
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import FrameKinematics, FrameMotion
from hsp_control.tasks.feedback import ErrorPart, Feedback, add_feedback
from hsp_control.tasks.frame_task import FrameTask, place_orientation
from hsp_control.tasks.task import Drawn
from hsp_control.trajectories import (
    HoldOrientation,
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.crossfade import AnyReference

ANTIPODE_MARGIN = 0.02
"""Smallest 1 + cos(angle) of the coordinates; below it (angle > 168°) they are held."""


class Pointing(FrameTask, type="pointing"):
    """e = -(n_x, n_y)/(1 + n_z), the direction n of an axis in the desired frame [-].

    Two rows; the rotation about the axis itself is free. e are stereographic
    coordinates about the desired direction, |e| = tan(angle/2), in which the error
    equation is exact up to the antipode (docs/law.md). Within 12 degrees of the
    antipode |e| is held at 9.9: the error equation no longer holds there, but the axis
    still moves back. The acceleration is then proportional to the sine of the angle:
    an axis that rests exactly at the antipode stays there.

    J are the angular rows of the frame's Jacobian along two directions perpendicular
    to the axis.
    """

    drawn: ClassVar[tuple[Drawn, ...]] = ("direction",)

    direction: Vector3 | None = None
    """The desired direction in the world, of any length but zero [-]."""
    _: KW_ONLY
    axis: Vector3 = (0.0, 0.0, 1.0)
    """The pointing axis in the frame, of any length but zero [-]."""
    trajectory: OrientationTrajectory | None = None
    """Instead of `direction`, one that moves: an orientation, world ← desired frame,
    whose third axis is the desired direction [rad]. What is omitted is such that the
    axis points along it at the start."""

    def __post_init__(self) -> None:
        """Check axis and direction."""
        if (self.direction is None) == (self.trajectory is None):
            raise TaskError("give one of direction and trajectory")
        for name in ("axis", "direction"):
            value = getattr(self, name)
            if value is not None and not np.linalg.norm(value) > 0.0:
                raise TaskError(f"{name} must be non-zero, got [0, 0, 0]")

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The stereographic coordinates."""
        return (ErrorPart("tan of half the angle", "-", "1/s", 2),)

    def _default_name(self) -> str:
        return f"{super()._default_name()}_pointing"

    @property
    def followed(self) -> OrientationTrajectory:
        """The trajectory of a placed task, whose third axis is the direction."""
        return self._desired

    def following(self, trajectory: AnyReference) -> Self:
        """Return the task with another trajectory."""
        changes: dict[str, Any] = {"direction": None, "trajectory": trajectory}
        return replace(self, **changes)

    def _placed_at(self, here: FrameKinematics) -> dict[str, Any]:
        if self.trajectory is None:
            return {}
        turned = here.rotation @ self._turn
        return {"trajectory": place_orientation(self.trajectory, turned, None)}

    @cached_property
    def _desired(self) -> OrientationTrajectory:
        if self.direction is None:
            assert self.trajectory is not None
            return self.trajectory
        return HoldOrientation(_facing(np.asarray(self.direction)))

    @cached_property
    def _axis(self) -> Array:
        """The axis, of length 1."""
        axis = np.asarray(self.axis, dtype=float)
        return np.asarray(axis / np.linalg.norm(axis))

    @property
    def _turn(self) -> Array:
        """The shortest rotation of the frame that makes the axis its third one."""
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), self._axis)
        return np.array(turn.toRotationMatrix())

    @cached_property
    def _normals(self) -> Array:
        """Two unit vectors across the axis, right-handed with it: the rows."""
        normals = np.linalg.svd(self._axis[None, :])[2][1:]
        normals[1] *= np.sign(np.linalg.det(np.vstack([normals, self._axis])))
        return normals.copy()

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel; see `Task.kernel`."""
        axes = self._axis, self._normals
        frame = state.frame(self.frame_name)
        return _pointing, (*axes, frame, self._desired, np.zeros((14, 3)))

    def reference_rate(self, state: RobotState) -> Array:
        """Return the part of w_d perpendicular to the axis, shape (2,) [rad/s]."""
        w_d = self._desired.sample(state.t).angular_velocity
        return self._normals @ state.frame(self.frame_name).rotation.T @ w_d

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual direction, unit vectors in the world, (3,) each."""
        desired = self._desired.sample(state.t).rotation[:, 2].copy()
        return desired, state.frame(self.frame_name).rotation @ self._axis


def _facing(direction: Array) -> Array:
    """Return a rotation whose third axis is a direction."""
    length = float(np.linalg.norm(direction))
    x, y = np.linalg.svd(direction[None, :] / length)[2][1:]
    rotation = np.column_stack([x, y, direction / length])
    rotation[:, 0] *= np.sign(np.linalg.det(rotation))
    return rotation


@kernel
def _pointing(
    axis: Array,
    normals: Array,
    frame: FrameMotion,
    desired: OrientationSample,
    scratch: Array,
    feedback: Feedback,
    out: TaskSample,
) -> None:
    """Write the sample.

    With m the axis in the world, n = R_dᵀ m and n' = R_dᵀ((w - w_d) × m). The
    coordinates y = n_xy/s, s = 1 + n_z, are conformal: y' = Q n'/s, where
    Q v = v_xy - n_xy v_z/s is an isometry of the tangent plane at n. Hence y'' = u
    needs the acceleration of n along the sphere

        s Qᵀu + 2 (s'/s) n' - (|n'|²/s) ẑ,   ẑ the part of z perpendicular to n,

    where s Qᵀu = -Qᵀ(Kv Q n' + Kp n_xy) for u = -Kv y' - Kp y. Only the terms of
    second order in n' grow towards the antipode; they are kept bounded.
    """
    J_frame, J_frame_dot, R = frame.jacobian, frame.jacobian_dot, frame.rotation
    w = frame.velocity[3:]
    R_d, w_d, w_d_dot = desired
    J, J_dot, e, e_dot, a_x = out
    m, c0, c1 = scratch[0], scratch[1], scratch[2]
    w_rel, m_rel, n, n_dot, n_ddot_free, turn, moved = (
        scratch[3],
        scratch[4],
        scratch[5],
        scratch[6],
        scratch[7],
        scratch[8],
        scratch[9],
    )
    rotate(R, axis, m)
    rotate(R, normals[0], c0)
    rotate(R, normals[1], c1)

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

    # n, n' and the part of n'' that does not depend on w'.
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
    rotate_back(R_d, moved, n_ddot_free)

    # s e and s e', which stay bounded, and the feedback s u of Kv, Kp and the offset.
    s = max(1.0 + n[2], ANTIPODE_MARGIN)
    e_scaled, e_dot_scaled, wanted, zero = (
        scratch[10, :2],
        scratch[11, :2],
        scratch[12, :2],
        scratch[13, :2],
    )
    _flatten(n, n_dot, e_dot_scaled)
    for k in range(2):
        e_scaled[k] = -n[k]
        e_dot_scaled[k] = -e_dot_scaled[k]
        e_dot[k] = e_dot_scaled[k] / s
        zero[k] = 0.0
    _stereographic(n, e)
    gains = Feedback(feedback.Kp, feedback.Kv, zero, feedback.largest[:0])
    add_feedback(zero, gains, e_scaled, e_dot_scaled, wanted)
    for k in range(2):
        wanted[k] += s * feedback.offset[k]

    # The tangent vectors R_dᵀc0 and R_dᵀc1: w' along c1 accelerates n along the first,
    # w' along c0 against the second.
    square = n_dot[0] * n_dot[0] + n_dot[1] * n_dot[1] + n_dot[2] * n_dot[2]
    for k in range(2):
        rotate_back(R_d, c0 if k == 0 else c1, turn)
        _flatten(n, turn, moved)
        total = moved[0] * wanted[0] + moved[1] * wanted[1] - square / s * turn[2]
        for i in range(3):
            total += turn[i] * (2.0 * n_dot[2] / s * n_dot[i] - n_ddot_free[i])
        if k == 0:
            a_x[1] = total
        else:
            a_x[0] = -total


@kernel
def _flatten(n: Array, v: Array, out: Array) -> None:
    """Write Q v = v_xy - n_xy v_z/(1 + n_z) for v perpendicular to the unit vector n.

    For n_z ≤ -0.5, where digits would cancel, v_z comes from v · n = 0: Q is then a
    reflection of v_xy, stretched along n_xy.
    """
    if n[2] > -0.5:
        for k in range(2):
            out[k] = v[k] - n[k] * v[2] / (1.0 + n[2])
        return
    x, y = _horizontal(n)
    along = (x * v[0] + y * v[1]) * (1.0 - n[2]) / n[2]
    out[0], out[1] = v[0] + x * along, v[1] + y * along


@kernel
def _stereographic(n: Array, e: Array) -> None:
    """Write -n_xy/(1 + n_z), with 1 + n_z at least ANTIPODE_MARGIN."""
    if 1.0 + n[2] >= ANTIPODE_MARGIN:
        for k in range(2):
            e[k] = -n[k] / (1.0 + n[2])
        return
    longest = sqrt(2.0 / ANTIPODE_MARGIN - 1.0)
    x, y = _horizontal(n)
    e[0], e[1] = -longest * x, -longest * y


@kernel
def _horizontal(n: Array) -> tuple[float, float]:
    """Return the unit vector along n_xy, or (1, 0) if n_xy is zero."""
    length = sqrt(n[0] * n[0] + n[1] * n[1])
    if length == 0.0:
        return 1.0, 0.0
    return n[0] / length, n[1] / length
