"""Distances that must not fall below a least one, as bounds on the acceleration."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.geometry import Proximity
from hsp_control.robot import RobotState

_STEP = 3e-4
"""Of the differences along the flow [s]: rounding and truncation meet near 1e-8."""
_AHEAD = 0.5
"""How soon a distance must matter to be worth a row [s]."""


class MinimumDistance:
    """Every distance of some pairs of shapes stays above a least one.

    With h = d - least, the rows ask for h'' + 2α h' + α² h ≥ 0 (an exponential control
    barrier function), h'' = ∇d·a + the drift of d' at constant velocity, which holds
    the motion of obstacles and of the nearest points.

    Attributes:
        proximity: The distances.
        least: What they stay above [m].
    """

    def __init__(self, proximity: Proximity, least: float) -> None:
        """Set the pairs and their least distance [m].

        Raises:
            LimitError: If it is negative or not finite.
        """
        if not 0.0 <= least < np.inf:
            raise LimitError(f"least distance is {least} m; must be at least 0")
        self.proximity = proximity
        self.least = float(least)

    def rows(self, state: RobotState, bandwidth: float) -> tuple[Array, Array]:
        """Return (A, b) with A a ≥ b, shapes (k, nv) and (k,), of the pairs at hand."""
        d = self.proximity.measure(state).copy()
        ahead = self.proximity.measure(state.ahead(_STEP)).copy()
        behind = self.proximity.measure(state.ahead(-_STEP)).copy()
        rate = (ahead - behind) / (2.0 * _STEP)
        drift = (ahead - 2.0 * d + behind) / _STEP**2
        h = d - self.least
        near = np.flatnonzero(h + _AHEAD * np.minimum(rate, 0.0) < 2.0 / bandwidth)
        A = np.zeros((len(near), state.robot.nv))
        for row, k in enumerate(near):
            slopes = np.zeros(len(d))
            slopes[k] = 1.0
            A[row] = self.proximity.gradient(state, slopes)
        b = -drift - 2.0 * bandwidth * rate - bandwidth**2 * h
        return A, b[near]

    def check_start(self, state: RobotState) -> None:
        """Refuse a start that is too near.

        Raises:
            LimitError: Names the pair and its distance.
        """
        distance, pair = self.proximity.nearest(state)
        if distance < self.least:
            raise LimitError(
                f"the start is outside the limits: {pair} are {distance:.4g} m apart, "
                f"must be at least {self.least:g} m"
            )
