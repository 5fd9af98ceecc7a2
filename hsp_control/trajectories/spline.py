"""Splines through waypoints, by SciPy."""

from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.exceptions import TrajectoryError
from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import PiecewisePolynomial


class Spline(PiecewisePolynomial):
    """min ∫ |x⁽ᵏ⁾|² dt through waypoints, k = (degree + 1) / 2, at rest at both ends.

    The spline of degree 3 (C²), 5 (C⁴) or 7 (C⁶) has the minimum acceleration, jerk or
    snap; its derivatives 1, 1 to 2 or 1 to 3 are zero at both ends. With degree 3 the
    acceleration therefore jumps at both ends; with 5 and 7 the motion is C² everywhere.
    `MinimumJerk` computes degree 5 without SciPy.

    Attributes:
        degree: 3, 5 or 7.
    """

    __slots__ = ("degree",)

    def __init__(self, waypoints: ArrayLike, times: ArrayLike, degree: int = 5) -> None:
        """Set the waypoints.

        Args:
            waypoints: At least two points, shape (m, n).
            times: Times of the waypoints, increasing, shape (m,) [s].
            degree: 3, 5 or 7.

        Raises:
            TrajectoryError: If the degree is not 3, 5 or 7, there are fewer than two
                waypoints, a shape does not fit, or the times do not increase.
        """
        # This import takes 0.2 s, so only splines import it.
        from scipy.interpolate import make_interp_spline

        if degree not in {3, 5, 7}:
            raise TrajectoryError(f"degree must be 3, 5 or 7; degree = {degree}")
        x = checks.array(waypoints, "waypoints", (None, None))
        t = checks.waypoint_times(times, len(x))
        rest: Any = [(k, np.zeros(x.shape[1])) for k in range(1, (degree + 1) // 2)]
        spline = make_interp_spline(t, x, k=degree, bc_type=(rest, rest))
        widths = np.diff(t)[:, np.newaxis]
        taylor = [  # in u, from the left end of each segment
            spline(t[:-1], nu=k) * widths**k / factorial(k)
            for k in range(1, degree + 1)
        ]
        super().__init__(t, np.stack([x[:-1], *taylor], axis=1), x[-1])
        self.degree = degree
