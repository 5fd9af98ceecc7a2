"""A rotation at constant angular velocity."""

from dataclasses import KW_ONLY
from functools import cached_property

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.rotations import turn
from hsp_control.declaration.quantities import Number, Vector3
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.orientation import OrientationTrajectory


class Spin(Compiled, OrientationTrajectory, type="spin"):
    """R(t) = exp(t ω) R0 with ω = rate · axis in the world frame, for all t."""

    axis: Vector3
    """Direction of the axis in the world, of any length but zero, shape (3,) [-]."""
    rate: Number
    """Angular rate about the axis [rad/s]."""
    _: KW_ONLY
    rotation: Rotation | None = None
    """R0, the orientation at t = 0, body to world: roll, pitch and yaw [rad], a
    quaternion or a matrix [-]; that in which the robot starts by default."""

    def __post_init__(self) -> None:
        """Check that the axis is not zero."""
        checks.direction(self.axis, "axis")

    def _kernel(self) -> Kernel:
        return self._call

    @cached_property
    def _call(self) -> Kernel:
        assert self.rotation is not None
        omega = self.rate * checks.direction(self.axis, "axis")
        return _spin, (np.asarray(omega), matrix_of(self.rotation))


@kernel
def _spin(
    omega: Array,
    start: Array,
    rotation: Array,
    velocity: Array,
    acceleration: Array,
    t: float,
) -> None:
    turn(start, omega, t, rotation)
    for i in range(3):
        velocity[i] = omega[i]
        acceleration[i] = 0.0
