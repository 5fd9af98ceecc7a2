"""A Lissajous curve: a sine in each coordinate."""

from math import cos, sin
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.declaration.quantities import Vector
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.trajectory import Trajectory


class Lissajous(Compiled, Trajectory, type="lissajous"):
    """x_i(t) = c_i + a_i sin(ω_i t + φ_i), for all t."""

    points: ClassVar[tuple[str, ...]] = ("center",)

    amplitudes: Vector
    """a, shape (n,) [m, or the task's unit]."""
    rates: Vector
    """ω, shape (n,) [rad/s]."""
    phases: Vector | None = None
    """φ at t = 0, shape (n,) [rad]; zero by default."""
    center: Vector | None = None
    """c, shape (n,) [m, or the task's unit]; where the robot starts by default."""

    def __post_init__(self) -> None:
        """Check that all have one shape."""
        shape = np.shape(self.amplitudes)
        checks.array(self.rates, "rates", shape)
        for name in ("phases", "center"):
            value = getattr(self, name)
            if value is not None:
                checks.array(value, name, shape)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return np.size(self.amplitudes)

    def _kernel(self) -> Kernel:
        phases = np.zeros(self.dimension) if self.phases is None else self.phases
        parameters = [self.center, self.amplitudes, self.rates, phases]
        return _lissajous, (np.array(parameters, dtype=float),)


@kernel
def _lissajous(
    parameters: Array, position: Array, velocity: Array, acceleration: Array, t: float
) -> None:
    for i in range(position.size):
        center, amplitude = parameters[0, i], parameters[1, i]
        rate, phase = parameters[2, i], parameters[3, i]
        swing = amplitude * sin(rate * t + phase)
        position[i] = center + swing
        velocity[i] = rate * amplitude * cos(rate * t + phase)
        acceleration[i] = -rate * rate * swing
