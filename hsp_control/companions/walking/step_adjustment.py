"""Place and time of touchdown that keep the divergent component bounded.

A push displaces the divergent component of motion ξ from its plan. An error that the
sole of the stance foot cannot correct must be corrected by the next step: farther, or
sooner. With ξ(T) predicted by the pendulum at touchdown,

    minimise  |u - u0|² + w_ξ |ξ(T) - ξ0 - s (u - u0)|² + w_T (T - T0)²

over the place u, within the reach of the legs, and the time T, between the earliest and
the latest one. ξ0 belongs to the planned step (u0, T0); a step that lands u - u0
farther needs a ξ that is s (u - u0) farther, s = (1 - e^{-ωD}) / (ωD), with D the
duration of the double support that follows.

After Khadiv, Herzog, Moosavian and Righetti 2020, "Walking control based on step timing
adaptation", IEEE Trans. Robotics 36(3), who have no double support and no feedback
within the sole. For a given T the best place has a closed form; T is searched.
"""

from collections.abc import Callable
from math import exp
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.walking.footsteps import Footstep

WEIGHT_DCM = 100.0
"""w_ξ, relative to the place of the step [-]."""
WEIGHT_TIME = 0.02
"""w_T, relative to the place of the step [m²/s²]."""
_TIMES = 12
"""Number of touchdown times that are compared."""


class Adjustment(NamedTuple):
    """An adjusted step.

    Attributes:
        target: Where the foot lands.
        remaining: Time until touchdown [s].
        left: Remaining error of the divergent component then, shape (2,) [m].
    """

    target: Footstep
    remaining: float
    left: Array


def shift_gain(frequency: float, double_support: float) -> float:
    """Return s, the shift of the divergent component per shift of the step."""
    x = frequency * double_support
    return (1.0 - exp(-x)) / x if x > 1e-9 else 1.0


def adjust(
    planned: Footstep,
    remaining: float,
    window: tuple[float, float],
    dcm_at: Callable[[float], Array],
    wanted: Array,
    shift: float,
    allowed: Callable[[Footstep], Footstep],
) -> Adjustment:
    """Return the place and time at which the foot is to land."""
    times = np.append(np.linspace(*window, _TIMES), remaining)
    best, least = Adjustment(planned, remaining, np.zeros(2)), np.inf
    share = WEIGHT_DCM * shift / (1.0 + WEIGHT_DCM * shift * shift)
    for T in times.tolist():
        missing = dcm_at(T) - wanted
        free = planned.point + share * missing
        place = allowed(Footstep(float(free[0]), float(free[1]), planned.yaw))
        moved = place.point - planned.point
        left = missing - shift * moved
        cost = float(
            moved @ moved
            + WEIGHT_DCM * (left @ left)
            + WEIGHT_TIME * (T - remaining) ** 2
        )
        if cost < least:
            best, least = Adjustment(place, T, left), cost
    return best
