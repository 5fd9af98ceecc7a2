"""An infinite straight line at constant speed."""

from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.declaration.quantities import Vector
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.trajectory import Trajectory


class UniformLine(Compiled, Trajectory, type="uniform_line"):
    """x(t) = x0 + t v, for all t. For a line that starts and stops use `Line`."""

    points: ClassVar[tuple[str, ...]] = ("start",)

    velocity: Vector
    """v, shape (n,) [m/s, or the task's unit per s]."""
    start: Vector | None = None
    """x0, the point at t = 0, shape (n,) [m, or the task's unit]; where the robot
    starts by default."""

    def __post_init__(self) -> None:
        """Check that both have one shape."""
        if self.start is not None:
            checks.array(self.velocity, "velocity", np.shape(self.start))

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return np.size(self.velocity)

    def _kernel(self) -> Kernel:
        return _line, (np.asarray(self.start), np.asarray(self.velocity))


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
