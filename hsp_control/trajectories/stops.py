"""Straight motions between waypoints, with a stop at each of them."""

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import PiecewisePolynomial
from hsp_control.trajectories.polynomial import QUINTIC


class Stops(PiecewisePolynomial):
    """x(t) = x_i + s (x_{i+1} - x_i) from t_i to t_{i+1}, s the `smooth_step`.

    Straight lines with rest at each waypoint, C² everywhere. For a pause, give the same
    waypoint twice.
    """

    __slots__ = ()

    def __init__(self, waypoints: ArrayLike, times: ArrayLike) -> None:
        """Set the waypoints.

        Args:
            waypoints: At least two points x_i, shape (m, n).
            times: Times t_i of the waypoints, increasing, shape (m,) [s].

        Raises:
            TrajectoryError: If there are fewer than two waypoints, a shape does not
                fit, a value is not finite, or the times do not increase.
        """
        x = checks.array(waypoints, "waypoints", (None, None))
        t = checks.waypoint_times(times, len(x))
        # (x, x', x'') at the start and at the end of each segment
        ends = np.zeros((len(x) - 1, 6, x.shape[1]))
        ends[:, 0], ends[:, 3] = x[:-1], x[1:]
        super().__init__(t, QUINTIC @ ends, x[-1])
