"""Bounds on the motion of a stream, in the coordinates of its chart."""

from math import pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError

PLANNED = 0.95
"""Share of an angular speed up to which motions are planned; see `angular_bounds`."""


class MotionBounds(NamedTuple):
    """Largest magnitude of the first three derivatives, for every coordinate."""

    speed: Array  # (n,) [1/s]
    acceleration: Array  # (n,) [1/s²]
    jerk: Array  # (n,) [1/s³]


def linear_bounds(
    speed: ArrayLike, acceleration: ArrayLike, jerk: ArrayLike, n: int
) -> MotionBounds:
    """Return bounds for each of n coordinates."""
    given = {"speed": speed, "acceleration": acceleration, "jerk": jerk}
    found = []
    for name, value in given.items():
        numbers = np.asarray(value, dtype=float)
        if numbers.ndim and numbers.shape != (n,):
            raise TrajectoryError(
                f"{name} has {numbers.size} numbers; the stream needs one or {n}"
            )
        found.append(np.broadcast_to(numbers, (n,)).copy())
    return MotionBounds(*found)


def angular_bounds(speed: float, acceleration: float, jerk: float) -> MotionBounds:
    """Return bounds on a rotation vector that keep those on ω, ω' and ω''; see `Chart`.

    A vector with components up to b/√3 is no longer than b. A piece has axes of its
    own; where one begins, a component of ω may be beyond its bound while all of ω is
    not, and is then brought back. For that the speed is planned 5 % smaller; the
    maximum in 400 adversarial streams was 0.5 %.
    """
    curved = acceleration - speed**2 / pi
    if curved <= 0.0:
        raise TrajectoryError(
            f"angular_acceleration is {acceleration:g}; with angular_speed {speed:g} "
            f"it must be greater than {speed**2 / pi:.4g} (angular_speed²/π)"
        )
    turned = jerk - speed * curved - speed**3 / 6.0
    if turned <= 0.0:
        raise TrajectoryError(
            f"angular_jerk is {jerk:g}; with these bounds it must be greater than "
            f"{speed * curved + speed**3 / 6.0:.4g}"
        )
    planned = PLANNED * speed, curved, turned
    return MotionBounds(*(np.full(3, each / sqrt(3.0)) for each in planned))
