"""A straight line without end, at constant speed."""

from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.trajectory import Trajectory


class UniformLine(Compiled, Trajectory):
    """x(t) = x0 + t v, for all t; `Line` is the one that starts and stops.

    Attributes:
        start: x0, where it is at t = 0, shape (n,).
        velocity: v, shape (n,) [1/s].
    """

    __slots__ = ("start", "velocity")

    def __init__(self, start: ArrayLike, velocity: ArrayLike) -> None:
        """Pass ``start`` at t = 0 with ``velocity``; both of shape (n,)."""
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
