"""Smooth transitions into a trajectory that moves, of a point or an orientation."""

from dataclasses import KW_ONLY, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Number, Positive, Vector, Vector3
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.engine.plans import PartCall
from hsp_control.trajectories import checks
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.trajectory import Trajectory


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
        """Whether it, or the trajectory, depends on the robot's start."""
        return self.trajectory.relative or super().relative

    def anchored(self, start: ArrayLike | None) -> Trajectory:
        """Return both in the world; see `Trajectory.anchored`."""
        inner = self.trajectory.anchored(start)
        placed = self if inner is self.trajectory else replace(self, trajectory=inner)
        return super(Blend, placed).anchored(start)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self.trajectory.dimension

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        x = np.asarray(self.start)
        v = np.zeros_like(x) if self.start_velocity is None else self.start_velocity
        start = np.stack([x, np.asarray(v)])
        return PartCall(
            engine.Blend,
            start_time=self.start_time,
            duration=self.duration,
            start=start,
            desired=self.trajectory,
        )


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
        """Whether it, or the trajectory, depends on the robot's start."""
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
    def coefficients(self) -> Array:
        """Those of y, a polynomial of (t - t0)/T, shape (6, 3)."""
        omega = np.asarray(self.start_angular_velocity)
        omega_dot = np.asarray(self.start_angular_acceleration)
        start = OrientationSample(self._start, omega, omega_dot)
        desired = self.trajectory.sample(self.start_time)
        return offset_coefficients(start, desired, self.duration)

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        return PartCall(
            engine.BlendOrientation,
            start_time=self.start_time,
            duration=self.duration,
            start=self._start,
            coefficients=self.coefficients,
            desired=self.trajectory,
        )


def offset_coefficients(
    start: OrientationSample, desired: OrientationSample, duration: float
) -> Array:
    """Return the coefficients of y for which R_d exp(y), ω and ω' are those of a start.

    w = Jexp(y) y' is the angular velocity relative to R_d, in the body frame.

    Args:
        start: R0, ω0 and ω0'.
        desired: R_d, ω_d and ω_d' at the same time.
        duration: T [s], after which y is zero.
    """
    coefficients = np.zeros((6, 3))
    engine.OffsetCoefficients(
        start=start, desired=desired, duration=duration, coefficients=coefficients
    )()
    return coefficients
