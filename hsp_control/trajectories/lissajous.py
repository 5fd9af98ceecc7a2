"""A Lissajous curve: a sine in each coordinate."""

from math import cos, sin

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.trajectory import Trajectory


class Lissajous(Compiled, Trajectory):
    """x_i(t) = c_i + a_i sin(ω_i t + φ_i), for all t.

    Attributes:
        center: c, shape (n,).
        amplitudes: a, shape (n,).
        rates: ω, shape (n,) [rad/s].
        phases: φ, shape (n,) [rad].
    """

    __slots__ = ("_parameters", "amplitudes", "center", "phases", "rates")

    def __init__(
        self,
        center: ArrayLike,
        amplitudes: ArrayLike,
        rates: ArrayLike,
        phases: ArrayLike | None = None,
    ) -> None:
        """Set the sines.

        Args:
            center: c, shape (n,).
            amplitudes: a, shape (n,).
            rates: ω, shape (n,) [rad/s].
            phases: φ, shape (n,) [rad]; 0 by default.

        Raises:
            TrajectoryError: If the shapes differ, or a value is not finite.
        """
        self.center = checks.array(center, "center", (None,))
        shape = self.center.shape
        self.amplitudes = checks.array(amplitudes, "amplitudes", shape)
        self.rates = checks.array(rates, "rates", shape)
        self.phases = checks.array(
            np.zeros(shape) if phases is None else phases, "phases", shape
        )
        self._parameters = np.stack(
            [self.center, self.amplitudes, self.rates, self.phases]
        )

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return len(self.center)

    def _kernel(self) -> Kernel:
        return _lissajous, (self._parameters,)


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
