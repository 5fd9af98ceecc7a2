"""Position, velocity and acceleration limits as bounds on the acceleration."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import kernel

_STEEPER = 4.0
"""How much steeper the velocity barrier is beyond the guarded speed."""

_SHIFT = 0.1
"""How much of a joint's range a mean error may take away at one end: a joint that
something blocks errs by all that it should accelerate."""

_HELD = 0.002
"""What the effort's rate can do in this time [s] is held against a force that lasts,
where that is more: a light wrist with a tool that nobody declared."""

MOTION, EFFORT = 1, 2
"""Flags of what is violated: bounds on the acceleration, bounds on the effort."""

BEYOND_POSITION = 1e-3
"""A joint that is so far behind the end of its range is beyond it [rad or m]."""
BEYOND_SPEED = 0.02
"""A joint that is faster by this part of its speed limit is beyond that: the noise of
a measured velocity is less."""


class MotionLimits(NamedTuple):
    """The limits that the barriers keep, margins included."""

    lower: Array  # lower position limit, shape (nv,) [rad or m]
    upper: Array  # upper position limit, shape (nv,) [rad or m]
    velocity: Array  # maximum speed, shape (nv,) [rad/s or m/s]
    acceleration: Array  # maximum acceleration, shape (nv,) [rad/s² or m/s²]
    # how fast the acceleration may change: the effort's rate over the joint's largest
    # inertia, shape (nv,) [rad/s³ or m/s³]
    jerk: Array
    bandwidth: Array  # α of the barriers, shape (1,) [1/s]


class Ends(NamedTuple):
    """Where a joint is beyond its limits, however it got there."""

    lower: Array  # lower position, shape (nv,) [rad or m]
    upper: Array  # upper position, shape (nv,) [rad or m]
    velocity: Array  # speed, shape (nv,) [rad/s or m/s]

    @classmethod
    def of(cls, lower: Array, upper: Array, velocity: Array) -> "Ends":
        """Return those of the limits themselves, shape (nv,) each."""
        return cls(
            lower - BEYOND_POSITION,
            upper + BEYOND_POSITION,
            (1.0 + BEYOND_SPEED) * velocity,
        )


class Bounds(NamedTuple):
    """Bounds of one step, shape (nv,) each."""

    a_lower: Array  # lower bound on the acceleration
    a_upper: Array  # upper bound on the acceleration
    tau_lower: Array  # lower bound on the effort
    tau_upper: Array  # upper bound on the effort


@kernel
def acceleration_bounds(
    q: Array,
    v: Array,
    where: Indices,
    limits: MotionLimits,
    error: Array,
    least: Array,
    most: Array,
    lasting: Array,
    steady: Array,
    a_lower: Array,
    a_upper: Array,
) -> None:
    """Write the bounds (nv,) on the acceleration that the barriers of `Limits` require.

    Where they contradict each other, position has priority over velocity, and velocity
    over acceleration: each narrows the range that the earlier ones leave, as far as it
    can. ``where`` is the index in q of each dof's coordinate, -1 for none.

    The margin of the speed covers the largest ``error`` that the acceleration had of
    late, up to half the speed. A position limit would be passed by a mean error over
    the bandwidth's square; so its barrier makes up for the worst mean of late that
    leads beyond it, ``least`` at the lower end and ``most`` at the upper one, and for
    all that is ``lasting`` now. ``steady`` is what of a longer mean is still there:
    what is commanded against a steady force moves nothing, and the barriers are wider
    by as much.
    """
    lower, upper, velocity, acceleration, jerk, alpha = limits
    bandwidth = alpha[0]
    for i in range(v.shape[0]):
        low, high = -np.inf, np.inf
        if where[i] >= 0:
            position = q[where[i]]
            damping = 2.0 * bandwidth * v[i]
            low = -bandwidth * bandwidth * (position - lower[i]) - damping
            high = bandwidth * bandwidth * (upper[i] - position) - damping
            shift = _SHIFT * bandwidth * bandwidth * (upper[i] - lower[i])
            held = max(shift, _HELD * jerk[i])
            low += max(min(-least[i], shift), min(-lasting[i], held))
            high -= max(min(most[i], shift), min(lasting[i], held))
            low -= max(steady[i], 0.0)
            high -= min(steady[i], 0.0)
        speed = velocity[i] - error[i] / (2.0 * bandwidth * _STEEPER)
        speed = max(speed, 0.5 * velocity[i])
        rising = _speed_barrier(speed - v[i], bandwidth, jerk[i])
        slowing = -_speed_barrier(speed + v[i], bandwidth, jerk[i])
        rising -= min(steady[i], 0.0)
        slowing -= max(steady[i], 0.0)
        if slowing > 0.0:
            slowing *= _STEEPER
            rising = max(rising, slowing)
        if rising < 0.0:
            rising *= _STEEPER
            slowing = min(slowing, rising)
        low, high = _narrow(low, high, slowing, rising)
        low, high = _narrow(low, high, -acceleration[i], acceleration[i])
        a_lower[i], a_upper[i] = low, high


@kernel
def _speed_barrier(gap: float, bandwidth: float, jerk: float) -> float:
    """Return the largest acceleration towards a speed limit that is so far away.

    It is 2α gap, and √(jerk gap) where that is less: then the acceleration ends at the
    limit though it can fall by half the jerk only, and the rest of the effort's rate is
    for what the other joints do.
    """
    barrier = 2.0 * bandwidth * gap
    if gap > 0.0 and jerk < np.inf:
        barrier = min(barrier, np.sqrt(jerk * gap))
    return barrier


@kernel
def violated_limits(
    q: Array,
    v: Array,
    a: Array,
    tau: Array,
    where: Indices,
    limits: MotionLimits,
    error: Array,
    least: Array,
    most: Array,
    lasting: Array,
    steady: Array,
    disturbance: Array,
    bounds: Bounds,
) -> int:
    """Write the bounds; return whether a and tau violate `MOTION`, `EFFORT` or the sum.

    The robot accelerates by a plus the disturbance, the acceleration that something
    else is known to cause, shape (nv,); so the bounds on a are moved by it. It makes a
    bound narrower by no more than the speed's barrier permits at rest, so that a push
    that ends does no harm. See `acceleration_bounds` for the other arguments.
    """
    acceleration_bounds(
        q,
        v,
        where,
        limits,
        error,
        least,
        most,
        lasting,
        steady,
        bounds.a_lower,
        bounds.a_upper,
    )
    for i in range(a.shape[0]):
        brake = 2.0 * limits.bandwidth[0] * limits.velocity[i]
        up, down = max(disturbance[i], 0.0), min(disturbance[i], 0.0)
        bounds.a_lower[i] -= up + max(down, -brake)
        bounds.a_upper[i] -= min(up, brake) + down
    violated = 0 if within(a, bounds.a_lower, bounds.a_upper) else MOTION
    effort_ok = within(tau, bounds.tau_lower, bounds.tau_upper)
    return violated if effort_ok else violated + EFFORT


@kernel
def is_beyond(q: Array, v: Array, where: Indices, ends: Ends) -> bool:
    """Return whether a joint is beyond a limit; see `acceleration_bounds` for where."""
    found = False
    for i in range(v.shape[0]):
        found = found or abs(v[i]) > ends.velocity[i]
        if where[i] >= 0:
            position = q[where[i]]
            found = found or not ends.lower[i] <= position <= ends.upper[i]
    return found


@kernel
def within(x: Array, lower: Array, upper: Array) -> bool:
    """Return whether every component of x is within its bounds."""
    inside = True
    for i in range(x.shape[0]):
        inside = inside and lower[i] <= x[i] <= upper[i]
    return inside


@kernel
def _narrow(low: float, high: float, lower: float, upper: float) -> tuple[float, float]:
    """Return the part of [low, high] within [lower, upper], or its nearest point."""
    return (max(low, min(lower, high)), min(high, max(upper, low)))
