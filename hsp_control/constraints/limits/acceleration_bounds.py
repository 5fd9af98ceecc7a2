"""Position, velocity and acceleration limits as bounds on the acceleration."""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel

_STEEPER = 4.0
"""How much steeper the velocity's barrier is beyond the guarded speed. With efforts
held for 1 ms that change at 1000 N·m/s the acceleration is wrong by M⁻¹·0.5 N·m, half a
rad/s² on a Panda, for as long as they change: the margin must be enough for it."""


MOTION, EFFORT = 1, 2
"""What may be broken."""


@kernel
def acceleration_bounds(
    q: Array,
    v: Array,
    where: Indices,
    lower: Array,
    upper: Array,
    velocity: Array,
    acceleration: Array,
    bandwidth: float,
    least: Array,
    greatest: Array,
) -> None:
    """Write the bounds that the barriers of `Limits` put on a.

    Where they contradict each other, position goes before velocity before acceleration:
    each narrows the range that those before it leave, as far as it can.

    Args:
        q: Configuration, shape (nq,).
        v: Velocity, shape (nv,).
        where: Where each freedom's coordinate stands in q, -1 for none, shape (nv,).
        lower: Least position, shape (nv,).
        upper: Greatest position, shape (nv,).
        velocity: Greatest speed, shape (nv,).
        acceleration: Greatest acceleration, shape (nv,).
        bandwidth: α [1/s].
        least: Least acceleration, shape (nv,).
        greatest: Greatest acceleration, shape (nv,).
    """
    for i in range(v.shape[0]):
        low, high = -np.inf, np.inf
        if where[i] >= 0:
            position = q[where[i]]
            damping = 2.0 * bandwidth * v[i]
            low = -bandwidth * bandwidth * (position - lower[i]) - damping
            high = bandwidth * bandwidth * (upper[i] - position) - damping
        slowing = 2.0 * bandwidth * (-velocity[i] - v[i])
        rising = 2.0 * bandwidth * (velocity[i] - v[i])
        if slowing > 0.0:
            slowing *= _STEEPER
            rising = max(rising, slowing)
        if rising < 0.0:
            rising *= _STEEPER
            slowing = min(slowing, rising)
        low, high = _narrow(low, high, slowing, rising)
        low, high = _narrow(low, high, -acceleration[i], acceleration[i])
        least[i], greatest[i] = low, high


@kernel
def keeps_limits(
    q: Array,
    v: Array,
    a: Array,
    tau: Array,
    where: Indices,
    lower: Array,
    upper: Array,
    velocity: Array,
    acceleration: Array,
    bandwidth: float,
    least: Array,
    greatest: Array,
    low: Array,
    high: Array,
) -> int:
    """Write the bounds, see `acceleration_bounds`; return which a and tau break.

    None, `MOTION`, `EFFORT`, or the sum of both.
    """
    acceleration_bounds(
        q, v, where, lower, upper, velocity, acceleration, bandwidth, least, greatest
    )
    broken = 0 if within(a, least, greatest) else MOTION
    return broken if within(tau, low, high) else broken + EFFORT


@kernel
def within(x: Array, least: Array, greatest: Array) -> bool:
    """Return whether every component is within its bounds."""
    inside = True
    for i in range(x.shape[0]):
        inside = inside and least[i] <= x[i] <= greatest[i]
    return inside


@kernel
def _narrow(
    low: float, high: float, least: float, greatest: float
) -> tuple[float, float]:
    """Return the part of [low, high] within [least, greatest], or its nearest point."""
    return (
        max(low, min(least, high)),
        min(high, max(greatest, low)),
    )
