"""Quintics that come to rest: motions of swing feet that can be redirected."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array


class FootMotion(NamedTuple):
    """Position, velocity and acceleration, shapes (n,) [m, m/s, m/s²]."""

    position: Array
    velocity: Array
    acceleration: Array


class Quintic(NamedTuple):
    """x(t) = Σ c_k (t - t0)ᵏ, k = 0 to 5, until t0 + T; at rest afterwards.

    Attributes:
        start: t0 [s].
        duration: T > 0 [s].
        coefficients: c, shape (6, n).
    """

    start: float
    duration: float
    coefficients: Array

    @property
    def end(self) -> float:
        """When it comes to rest [s]."""
        return self.start + self.duration

    def sample(self, t: float) -> FootMotion:
        """Return x, x' and x'' at time t [s]."""
        c = self.coefficients
        s = min(max(t - self.start, 0.0), self.duration)
        x = c[0] + s * (c[1] + s * (c[2] + s * (c[3] + s * (c[4] + s * c[5]))))
        if t >= self.end:
            return FootMotion(x, np.zeros_like(x), np.zeros_like(x))
        x_dot = c[1] + s * (2 * c[2] + s * (3 * c[3] + s * (4 * c[4] + 5 * s * c[5])))
        x_ddot = 2 * c[2] + s * (6 * c[3] + s * (12 * c[4] + s * 20 * c[5]))
        return FootMotion(x, x_dot, x_ddot)

    def accelerations(self, times: Array) -> Array:
        """Return x'' at many times, shape (m,) [s], as shape (m, n)."""
        c, s = self.coefficients, (times - self.start)[:, None]
        x_ddot = 2 * c[2] + s * (6 * c[3] + s * (12 * c[4] + s * 20 * c[5]))
        return np.asarray(np.where((s >= 0.0) & (s < self.duration), x_ddot, 0.0))


def to_rest(
    now: FootMotion, target: ArrayLike, start: float, duration: float
) -> Quintic:
    """Return the quintic from a motion to rest at a target, C² at its start."""
    T = duration
    x, v, a = (np.asarray(each, dtype=float) for each in now)
    # Remaining differences at the end in x, T x' and T² x''.
    d = np.asarray(target, dtype=float) - (x + T * v + 0.5 * T * T * a)
    e, f = -T * (v + T * a), -T * T * a
    c3 = 10.0 * d - 4.0 * e + 0.5 * f
    c4 = -15.0 * d + 7.0 * e - f
    c5 = 6.0 * d - 3.0 * e + 0.5 * f
    rows = np.array([x, v, 0.5 * a, c3 / T**3, c4 / T**4, c5 / T**5])
    return Quintic(start, T, rows)


def at_rest(position: ArrayLike) -> FootMotion:
    """Return a motion at rest."""
    x = np.array(position, dtype=float)
    return FootMotion(x, np.zeros_like(x), np.zeros_like(x))
