"""Splines through waypoints, by SciPy."""

from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.exceptions import TrajectoryError
from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import PiecewisePolynomial


class Spline(PiecewisePolynomial):
    """The spline of degree 3, 5 or 7 through waypoints, at rest at both ends.

    It is the motion of least acceleration (3, C²), jerk (5, C⁴) or snap (7, C⁶) through
    the waypoints, with derivatives 1, 1 to 2 or 1 to 3 zero at both ends. Of degree 3
    the acceleration therefore jumps where the motion meets its holds; the others are
    C² everywhere. `MinimumJerk` is degree 5 by another way.

    Attributes:
        degree: 3, 5 or 7.
    """

    __slots__ = ("degree",)

    def __init__(self, waypoints: ArrayLike, times: ArrayLike, degree: int = 5) -> None:
        """Pass through ``waypoints`` at ``times``.

        Args:
            waypoints: At least two points, shape (m, n).
            times: When to be there, increasing, shape (m,) [s].
            degree: 3, 5 or 7.

        Raises:
            TrajectoryError: If the degree is another one.
        """
        # 0.2 s that only splines shall cost
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
