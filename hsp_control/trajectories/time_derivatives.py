"""Derivatives of a function of time by central differences of sixth order.

They use seven values at t + k h, k = -3 .. 3. The truncation error of the first
derivative is h⁶ f⁽⁷⁾ / 140, of the second h⁶ f⁽⁸⁾ / 560; rounding adds up to
2 ε |f| / h and 6 ε |f| / h², with ε = 1.1e-16. With the default step of 5 ms the error
of the second derivative is 3e-11 for a sine of 1 rad/s, and 3e-9 for a sine of
10 rad/s, whose second derivative has the amplitude 1e2.
"""

from collections.abc import Callable

import numpy as np

from hsp_control.common.arrays import Array

STEP = 5e-3
"""Default step h [s]."""
_OFFSETS = (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0)
_FIRST = np.array([-1.0, 9.0, -45.0, 0.0, 45.0, -9.0, 1.0]) / 60.0
_SECOND = np.array([2.0, -27.0, 270.0, -490.0, 270.0, -27.0, 2.0]) / 180.0


def first_derivative(
    function: Callable[[float], Array], t: float, step: float
) -> Array:
    """Return f'(t) of a function with values of shape (n,); ``step`` is h [s]."""
    values = np.stack([function(t + k * step) for k in _OFFSETS])
    return _FIRST @ values / step


def both_derivatives(
    function: Callable[[float], Array], t: float, step: float
) -> tuple[Array, Array]:
    """Return f'(t) and f''(t), shape (n,) each; ``step`` is h [s]."""
    values = np.stack([function(t + k * step) for k in _OFFSETS])
    return _FIRST @ values / step, _SECOND @ values / (step * step)
