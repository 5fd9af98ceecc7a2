"""Straight motions between waypoints, with a stop at each of them."""

from typing import ClassVar

import numpy as np

from hsp_control.declaration.quantities import Matrix, Vector
from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import (
    Pieces,
    PolynomialTrajectory,
    join,
)
from hsp_control.trajectories.polynomial import QUINTIC


class Stops(PolynomialTrajectory, type="stops"):
    """x(t) = x_i + s (x_{i+1} - x_i) from t_i to t_{i+1}, s the `smooth_step`.

    Straight lines with rest at each waypoint, C² everywhere.
    """

    points: ClassVar[tuple[str, ...]] = ("waypoints",)

    waypoints: Matrix
    """At least two points x_i, shape (m, n) [m, or the task's unit]; the same point
    twice is a pause."""
    times: Vector
    """Times t_i of the waypoints, increasing, shape (m,) [s]."""

    def _pieces(self) -> Pieces:
        x = np.asarray(self.waypoints)
        t = checks.waypoint_times(self.times, len(x))
        # (x, x', x'') at the start and at the end of each segment
        ends = np.zeros((len(x) - 1, 6, x.shape[1]))
        ends[:, 0], ends[:, 3] = x[:-1], x[1:]
        return join(t, QUINTIC @ ends, x[-1])
