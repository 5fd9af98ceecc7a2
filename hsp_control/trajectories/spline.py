"""Splines through waypoints, by SciPy."""

from math import factorial
from typing import Any, ClassVar, Literal

import numpy as np

from hsp_control.declaration.quantities import Matrix, Vector
from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import (
    Pieces,
    PolynomialTrajectory,
    join,
)


class Spline(PolynomialTrajectory, type="spline"):
    """min ∫ |x⁽ᵏ⁾|² dt through waypoints, k = (degree + 1) / 2, at rest at both ends.

    The spline of degree 3 (C²), 5 (C⁴) or 7 (C⁶) has the minimum acceleration, jerk or
    snap; its derivatives 1, 1 to 2 or 1 to 3 are zero at both ends. With degree 3 the
    acceleration therefore jumps at both ends; with 5 and 7 the motion is C² everywhere.
    `MinimumJerk` computes degree 5 without SciPy.
    """

    points: ClassVar[tuple[str, ...]] = ("waypoints",)

    waypoints: Matrix
    """At least two points, shape (m, n) [m, or the task's unit]."""
    times: Vector
    """Times of the waypoints, increasing, shape (m,) [s]."""
    degree: Literal[3, 5, 7] = 5
    """Degree of the polynomials [-]."""

    def _pieces(self) -> Pieces:
        # This import takes 0.2 s, so only splines import it.
        from scipy.interpolate import make_interp_spline

        x, degree = np.asarray(self.waypoints), self.degree
        t = checks.waypoint_times(self.times, len(x))
        rest: Any = [(k, np.zeros(x.shape[1])) for k in range(1, (degree + 1) // 2)]
        spline = make_interp_spline(t, x, k=degree, bc_type=(rest, rest))
        widths = np.diff(t)[:, np.newaxis]
        taylor = [  # in u, from the left end of each segment
            spline(t[:-1], nu=k) * widths**k / factorial(k)
            for k in range(1, degree + 1)
        ]
        return join(t, np.stack([x[:-1], *taylor], axis=1), x[-1])
