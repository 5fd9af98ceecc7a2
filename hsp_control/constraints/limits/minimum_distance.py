"""Minimum distances, as bounds on the acceleration."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.geometry import Proximity
from hsp_control.robot import RobotState

_STEP = 3e-4
"""Step of the differences along the motion [s]: rounding and truncation errors are
equal near 1e-8."""
_AHEAD = 0.5
"""A pair gets a row if its distance may come close to the minimum within this time [s]
at its present rate."""


class MinimumDistance:
    """The distances of some pairs of shapes stay above a minimum.

    With h = d - minimum, the rows require h'' + 2α h' + α² h ≥ 0 (an exponential
    control barrier function). h'' = ∇d·a + the drift of d' at constant velocity; the
    drift includes the motion of the obstacles and of the nearest points.

    Attributes:
        proximity: The pairs and their distances.
        minimum: The minimum distance [m].
    """

    def __init__(self, proximity: Proximity, minimum: float) -> None:
        """Set the pairs and their minimum distance [m].

        Raises:
            LimitError: If the minimum is negative or not finite.
        """
        if not 0.0 <= minimum < np.inf:
            raise LimitError(f"minimum distance is {minimum} m; must be at least 0")
        self.proximity = proximity
        self.minimum = float(minimum)

    def rows(self, state: RobotState, bandwidth: float) -> tuple[Array, Array]:
        """Return the rows A a ≥ b of the pairs that are close or approaching.

        Args:
            state: The robot's state.
            bandwidth: α [1/s].

        Returns:
            A, shape (k, nv), and b, shape (k,).
        """
        d = self.proximity.measure(state).copy()
        ahead = self.proximity.measure(state.ahead(_STEP)).copy()
        behind = self.proximity.measure(state.ahead(-_STEP)).copy()
        rate = (ahead - behind) / (2.0 * _STEP)
        drift = (ahead - 2.0 * d + behind) / _STEP**2
        h = d - self.minimum
        near = np.flatnonzero(h + _AHEAD * np.minimum(rate, 0.0) < 2.0 / bandwidth)
        A = np.zeros((len(near), state.robot.nv))
        for row, k in enumerate(near):
            slopes = np.zeros(len(d))
            slopes[k] = 1.0
            A[row] = self.proximity.gradient(state, slopes)
        b = -drift - 2.0 * bandwidth * rate - bandwidth**2 * h
        return A, b[near]

    def check_start(self, state: RobotState) -> None:
        """Check that no pair starts closer than the minimum distance.

        Raises:
            LimitError: Names the nearest pair and its distance.
        """
        distance, pair = self.proximity.nearest(state)
        if distance < self.minimum:
            raise LimitError(
                f"the start is outside the limits: {pair} are {distance:.4g} m apart, "
                f"must be at least {self.minimum:g} m"
            )
