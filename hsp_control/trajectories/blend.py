"""Smooth transitions into a trajectory that moves, of a point or an orientation."""

from dataclasses import KW_ONLY, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.compiled.linalg import multiply
from hsp_control.compiled.rotations import (
    compose_back,
    cross,
    jexp3,
    jexp3_dot,
    jlog3,
    log3,
    rotate,
    turn,
)
from hsp_control.compiled.step_plan import planned
from hsp_control.declaration.quantities import Number, Positive, Vector, Vector3
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.trajectories import checks
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.piecewise_polynomial import QUINTIC, horner
from hsp_control.trajectories.schedule import smooth_step
from hsp_control.trajectories.trajectory import (
    Trajectory,
    TrajectorySample,
)


class Blend(Trajectory, type="blend"):
    """x(t) = (1 - s) (x0 + (t - t0) v0) + s x_d(t), with s the `smooth_step`.

    It is C² from t0 on: it starts at x0 with velocity v0 and zero acceleration, and
    equals x_d from t0 + T on. Before t0 it rests at x0.
    """

    points = ("start",)

    trajectory: Trajectory
    """x_d."""
    duration: Positive
    """T [s]."""
    _: KW_ONLY
    start: Vector | None = None
    """x0, shape (n,) [m, or the task's unit]; where the robot starts by default."""
    start_velocity: Vector | None = None
    """v0, shape (n,) [m/s, or the task's unit per s]; zero by default."""
    start_time: Number = 0.0
    """t0 [s]."""

    def __post_init__(self) -> None:
        """Check that all have one dimension."""
        if self.relative:
            return
        shape = (self.trajectory.dimension,)
        checks.array(np.asarray(self.start), "start", shape)
        if self.start_velocity is not None:
            checks.array(self.start_velocity, "start_velocity", shape)

    @property
    def relative(self) -> bool:
        """Whether it, or the trajectory, depends on where the robot starts."""
        return self.trajectory.relative or super().relative

    def anchored(self, start: ArrayLike | None) -> Self:
        """Return both in the world; see `Trajectory.anchored`."""
        inner = self.trajectory.anchored(start)
        if not self.relative:
            return super().anchored(start)
        return super(Blend, replace(self, trajectory=inner)).anchored(start)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self.trajectory.dimension

    def kernel(self) -> KernelCall:
        """Return the kernel; see `Trajectory.kernel`."""
        x = np.asarray(self.start)
        v = np.zeros_like(x) if self.start_velocity is None else self.start_velocity
        start = np.stack([x, np.asarray(v)])
        return _blend, (self.start_time, self.duration, start, self.trajectory)


@kernel
def _blend(
    start_time: float,
    duration: float,
    start_state: Array,
    desired: TrajectorySample,
    out: TrajectorySample,
    t: float,
) -> None:
    """Blend x_d with the line x0 + (t - t0) v0; ``start_state`` is x0 and v0."""
    position, velocity, acceleration = out
    x_d, v_d, a_d = desired
    elapsed = t - start_time
    s, s_dot, s_ddot = smooth_step(elapsed, 0.0, duration)
    for i in range(position.size):
        if elapsed < 0.0:
            position[i], velocity[i], acceleration[i] = start_state[0, i], 0.0, 0.0
        elif elapsed >= duration:
            position[i], velocity[i], acceleration[i] = x_d[i], v_d[i], a_d[i]
        else:
            x, v = start_state[0, i] + elapsed * start_state[1, i], start_state[1, i]
            gap, gap_dot = x_d[i] - x, v_d[i] - v
            position[i] = x + s * gap
            velocity[i] = v + s_dot * gap + s * gap_dot
            acceleration[i] = s_ddot * gap + 2.0 * s_dot * gap_dot + s * a_d[i]


class BlendOrientation(OrientationTrajectory, type="blend"):
    """R(t) = R_d(t) exp(y(t)), y a quintic with y = y' = y'' = 0 at t0 + T.

    y, y' and y'' at t0 are such that the body starts at R0 with angular velocity ω0 and
    angular acceleration ω0'. The motion is C² from t0 on, equals R_d from t0 + T on,
    and rests at R0 before t0. It needs the logarithm at t0 only. It is therefore smooth
    for any R_d, whereas exp(s log(R0ᵀ R_d)) jumps where R_d passes an angle of π from
    R0.
    """

    trajectory: OrientationTrajectory
    """R_d."""
    duration: Positive
    """T [s]."""
    _: KW_ONLY
    rotation: Rotation | None = None
    """R0, body to world: roll, pitch and yaw [rad], a quaternion or a matrix [-]; the
    orientation in which the robot starts by default."""
    start_angular_velocity: Vector3 = (0.0, 0.0, 0.0)
    """ω0 in the world frame, shape (3,) [rad/s]."""
    start_angular_acceleration: Vector3 = (0.0, 0.0, 0.0)
    """ω0' in the world frame, shape (3,) [rad/s²]."""
    start_time: Number = 0.0
    """t0 [s]."""

    @property
    def relative(self) -> bool:
        """Whether it, or the trajectory, depends on how the robot starts."""
        return self.rotation is None or self.trajectory.relative

    def anchored(self, start: ArrayLike) -> Self:
        """Return both with the start orientation; see `OrientationTrajectory`."""
        rotation = start if self.rotation is None else self.rotation
        inner = self.trajectory.anchored(start)
        return replace(self, trajectory=inner, rotation=rotation)

    @cached_property
    def _start(self) -> Array:
        assert self.rotation is not None
        return matrix_of(self.rotation)

    @cached_property
    def _coefficients(self) -> Array:
        T, rest = self.duration, np.zeros(3)
        y, y_dot, y_ddot = self._start_offset()
        return QUINTIC @ np.stack([y, T * y_dot, T * T * y_ddot, rest, rest, rest])

    def _start_offset(self) -> tuple[Array, Array, Array]:
        """Return y, y' and y'' at t0, with which ω = ω_d + R w = ω0 and ω' = ω0'.

        w = Jexp(y) y' is the angular velocity relative to R_d, in the body frame.
        """
        R_d, omega_d, omega_d_dot = self.trajectory.sample(self.start_time)
        R, omega = self._start, np.asarray(self.start_angular_velocity)
        w = R.T @ (omega - omega_d)
        omega_dot = np.asarray(self.start_angular_acceleration)
        w_dot = R.T @ (omega_dot - omega_d_dot - np.cross(omega, R @ w))
        y, y_dot, y_ddot = np.empty((3, 3))
        given = R_d, R, w, w_dot, np.empty((3, 3)), y, y_dot, y_ddot
        planned([(_offset, given)]).run(0.0)
        return y, y_dot, y_ddot

    def kernel(self) -> KernelCall:
        """Return the kernel; see `Trajectory.kernel`."""
        motion = self._start, self._coefficients, np.empty((11, 3))
        when = self.start_time, self.duration
        return _blend_orientation, (*when, *motion, self.trajectory)


@kernel
def _offset(
    R_d: Array,
    R: Array,
    w: Array,
    w_dot: Array,
    work: Array,
    y: Array,
    y_dot: Array,
    y_ddot: Array,
) -> None:
    """Write y = log(R_dᵀ R) and its derivatives, with w = Jexp(y) y' and w'."""
    compose_back(R_d, R, work)
    log3(work, y)
    jlog3(y, work)
    multiply(work, w, y_dot)
    jexp3_dot(y, y_dot, work)
    multiply(work, y_dot, y_ddot)
    for i in range(3):
        w_dot[i] -= y_ddot[i]
    jlog3(y, work)
    multiply(work, w_dot, y_ddot)


@kernel
def _blend_orientation(
    start_time: float,
    duration: float,
    start: Array,
    coefficients: Array,
    work: Array,
    desired: OrientationSample,
    out: OrientationSample,
    t: float,
) -> None:
    """Write R_d exp(y).

    ω = ω_d + R w and ω' = ω_d' + ω × R w + R w', where w = Jexp y' in the body frame.
    """
    rotation, velocity, acceleration = out
    R_d, omega_d, omega_d_dot = desired
    elapsed = t - start_time
    for i in range(3):
        velocity[i], acceleration[i] = omega_d[i], omega_d_dot[i]
        if elapsed < 0.0:
            velocity[i] = acceleration[i] = 0.0
        for j in range(3):
            rotation[i, j] = start[i, j] if elapsed < 0.0 else R_d[i, j]
    if not 0.0 <= elapsed < duration:
        return
    y, y_dot, y_ddot = work[0], work[1], work[2]
    w, w_dot = work[3], work[4]
    J, J_dot = work[5:8], work[8:11]
    horner(elapsed / duration, duration, coefficients, y, y_dot, y_ddot)
    jexp3(y, J)
    jexp3_dot(y, y_dot, J_dot)
    rotate(J, y_dot, w)
    rotate(J_dot, y_dot, w_dot)
    rotate(J, y_ddot, y_ddot)
    for i in range(3):
        w_dot[i] += y_ddot[i]
    rotate(rotation, y, y)  # R_d exp(y) = exp(R_d y) R_d
    turn(rotation, y, 1.0, rotation)
    rotate(rotation, w, w)
    rotate(rotation, w_dot, w_dot)
    for i in range(3):
        velocity[i] += w[i]
        acceleration[i] += w_dot[i]
    cross(velocity, w, w)
    for i in range(3):
        acceleration[i] += w[i]
