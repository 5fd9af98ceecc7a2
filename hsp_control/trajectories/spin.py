"""A rotation at constant angular velocity."""

from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.rotations import turn
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.orientation import OrientationTrajectory


class Spin(Compiled, OrientationTrajectory):
    """R(t) = exp(t ω) R0 with ω = rate · axis in the world frame, for all t.

    Attributes:
        rotation: R0, the orientation at t = 0, body to world, shape (3, 3).
        axis: Unit vector in the world frame, shape (3,).
        rate: Angular rate about the axis [rad/s].
    """

    __slots__ = ("_angular_velocity", "axis", "rate", "rotation")

    def __init__(self, rotation: ArrayLike, axis: ArrayLike, rate: float) -> None:
        """Set the rotation.

        Args:
            rotation: R0, the orientation at t = 0, body to world, shape (3, 3).
            axis: Direction in the world frame, of any length but zero, shape (3,).
            rate: Angular rate about the axis [rad/s].

        Raises:
            TrajectoryError: If R0 is not a rotation matrix, the axis is zero, or a
                value is not finite.
        """
        self.rotation = checks.rotation(rotation, "rotation")
        self.axis = checks.direction(axis, "axis")
        self.rate = checks.number(rate, "rate")
        self._angular_velocity = self.rate * self.axis

    def _kernel(self) -> Kernel:
        return _spin, (self._angular_velocity, self.rotation)


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
