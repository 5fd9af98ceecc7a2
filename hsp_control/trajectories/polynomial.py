"""Polynomials in u from 0 to 1: evaluation with rates, and quintics from end values."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel

# Row k maps (x, x', x'') at u = 0 and (x, x', x'') at u = 1 to the coefficient of u^k.
QUINTIC: Array = np.array(
    [
        [1.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 1.0, 0.0, 0.0, 0.0, 0.0],
        [0.0, 0.0, 0.5, 0.0, 0.0, 0.0],
        [-10.0, -6.0, -1.5, 10.0, -4.0, 0.5],
        [15.0, 8.0, 1.5, -15.0, 7.0, -1.0],
        [-6.0, -3.0, -0.5, 6.0, -3.0, 0.5],
    ]
)
QUINTIC.setflags(write=False)


@kernel
def horner(
    u: float,
    width: float,
    coefficients: Array,
    position: Array,
    velocity: Array,
    acceleration: Array,
) -> None:
    """Write Σ_k c_k u^k and its two time derivatives, where u' = 1 / width.

    Shapes: coefficients (degree + 1, n), position (n,), velocity (n,) [1/s],
    acceleration (n,) [1/s²].
    """
    for j in range(position.size):
        x, x_dot, half_x_ddot = 0.0, 0.0, 0.0  # Horner's scheme and its derivatives
        for k in range(coefficients.shape[0] - 1, -1, -1):
            half_x_ddot = half_x_ddot * u + x_dot
            x_dot = x_dot * u + x
            x = x * u + coefficients[k, j]
        position[j] = x
        velocity[j] = x_dot / width
        acceleration[j] = 2.0 * half_x_ddot / (width * width)
