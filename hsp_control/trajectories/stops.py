"""From stop to stop."""

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import PiecewisePolynomial
from hsp_control.trajectories.polynomial import QUINTIC


class Stops(PiecewisePolynomial):
    """Straight from waypoint to waypoint by quintics, at rest at each of them.

    C² throughout. The same waypoint twice is a pause.
    """

    __slots__ = ()

    def __init__(self, waypoints: ArrayLike, times: ArrayLike) -> None:
        """Stop at ``waypoints`` at ``times``.

        Args:
            waypoints: At least two points, shape (m, n).
            times: When to be there, increasing, shape (m,) [s].

        Raises:
            TrajectoryError: If there are fewer, or the times do not increase.
        """
        x = checks.array(waypoints, "waypoints", (None, None))
        t = checks.waypoint_times(times, len(x))
        # (x, x', x'') at the start and at the end of each segment
        ends = np.zeros((len(x) - 1, 6, x.shape[1]))
        ends[:, 0], ends[:, 3] = x[:-1], x[1:]
        super().__init__(t, QUINTIC @ ends, x[-1])
