"""An infinite straight line at constant speed."""

from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.trajectory import Trajectory


class UniformLine(Compiled, Trajectory):
    """x(t) = x0 + t v, for all t. For a line that starts and stops use `Line`.

    Attributes:
        start: x0, the point at t = 0, shape (n,).
        velocity: v, shape (n,) [1/s].
    """

    __slots__ = ("start", "velocity")

    def __init__(self, start: ArrayLike, velocity: ArrayLike) -> None:
        """Set the line.

        Args:
            start: x0, the point at t = 0, shape (n,).
            velocity: v, shape (n,) [1/s].

        Raises:
            TrajectoryError: If the shapes differ, or a value is not finite.
        """
        self.start = checks.array(start, "start", (None,))
        self.velocity = checks.array(velocity, "velocity", self.start.shape)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return len(self.start)

    def _kernel(self) -> Kernel:
        return _line, (self.start, self.velocity)


@kernel
def _line(
    start: Array,
    constant_velocity: Array,
    position: Array,
    velocity: Array,
    acceleration: Array,
    t: float,
) -> None:
    for i in range(position.size):
        position[i] = start[i] + t * constant_velocity[i]
        velocity[i] = constant_velocity[i]
        acceleration[i] = 0.0
