"""Position, velocity and acceleration limits as bounds on the acceleration."""

from typing import NamedTuple

from hsp_control.common.arrays import Array

BEYOND_POSITION = 1e-3
"""Tolerance beyond the end of a joint's range [rad or m]."""
BEYOND_SPEED = 0.02
"""Tolerance beyond a speed limit, relative to it: more than the noise of a measured
velocity."""


class MotionLimits(NamedTuple):
    """The limits that the barriers enforce, margins included."""

    lower: Array  # lower position limit, shape (nv,) [rad or m]
    upper: Array  # upper position limit, shape (nv,) [rad or m]
    velocity: Array  # maximum speed, shape (nv,) [rad/s or m/s]
    acceleration: Array  # maximum acceleration, shape (nv,) [rad/s² or m/s²]
    # maximum rate of the acceleration: the effort's rate over the joint's largest
    # inertia, shape (nv,) [rad/s³ or m/s³]
    jerk: Array
    bandwidth: Array  # α of the barriers, shape (1,) [1/s]


class Ends(NamedTuple):
    """The values beyond which a joint violates its limits."""

    lower: Array  # lower position, shape (nv,) [rad or m]
    upper: Array  # upper position, shape (nv,) [rad or m]
    velocity: Array  # speed, shape (nv,) [rad/s or m/s]

    @classmethod
    def of(cls, lower: Array, upper: Array, velocity: Array) -> "Ends":
        """Return the ends of the limits themselves, shapes (nv,)."""
        return cls(
            lower - BEYOND_POSITION,
            upper + BEYOND_POSITION,
            (1.0 + BEYOND_SPEED) * velocity,
        )


class Bounds(NamedTuple):
    """Bounds of one step, shapes (nv,)."""

    a_lower: Array  # lower bound on the acceleration
    a_upper: Array  # upper bound on the acceleration
    tau_lower: Array  # lower bound on the effort
    tau_upper: Array  # upper bound on the effort
