"""How far an acceleration is beyond limits, relative to what they permit far from them.

The permitted value is, for an effort, its maximum; for an acceleration, that of the
barriers of `Limits` far from them. The engine has the equations.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array


class Wanted(NamedTuple):
    """The law's command, and that of compensators."""

    mass_matrix: Array  # M, shape (nv, nv)
    acceleration: Array  # a, shape (nv,)
    # M a + N and friction, without contact forces, shape (nv,) [N·m or N]
    effort: Array


class Permitted(NamedTuple):
    """The bounds far from all limits, shapes (nv,); inf without one."""

    effort: Array  # [N·m or N]
    acceleration: Array  # [rad/s² or m/s²]
    bandwidth: float  # α of the barriers [1/s]

    @classmethod
    def by(
        cls, effort: Array, span: Array, speed: Array, most: Array, bandwidth: float
    ) -> Self:
        """Return the bounds far from all limits of a robot.

        Args:
            effort: Maximum efforts, shape (nv,) as all of these.
            span: Upper minus lower position limits.
            speed: Maximum speeds.
            most: Maximum accelerations.
            bandwidth: α of the barriers that keep positions and speeds [1/s].
        """
        acceleration = np.minimum(bandwidth * speed, bandwidth**2 * (0.5 * span))
        return cls(np.array(effort), np.minimum(acceleration, most), float(bandwidth))


class StepLimits(NamedTuple):
    """The limits of a step."""

    lower: Array  # of the acceleration, shape (nv,)
    upper: Array  # shape (nv,)
    # rows of barriers: rows δ ≥ least for a deviation δ from the unconstrained a
    rows: Array  # shape (k, at least nv)
    least: Array  # shape (k,)
    permitted: Permitted  # far from them
