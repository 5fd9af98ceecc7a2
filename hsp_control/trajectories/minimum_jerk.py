"""The minimum-jerk motion through waypoints."""

from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import Matrix, Vector
from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import (
    Pieces,
    PolynomialTrajectory,
    join,
)
from hsp_control.trajectories.polynomial import QUINTIC

# Third and fourth derivative of Σ c_k u^k at u = 0 and u = 1, as functions of the end
# values of the quintic; the rows of `QUINTIC` give its coefficients.
_START = np.array([6.0 * QUINTIC[3], 24.0 * QUINTIC[4]])
_END = np.array(
    [
        6.0 * QUINTIC[3] + 24.0 * QUINTIC[4] + 60.0 * QUINTIC[5],
        24.0 * QUINTIC[4] + 120.0 * QUINTIC[5],
    ]
)


class MinimumJerk(PolynomialTrajectory, type="minimum_jerk"):
    """min ∫ |x'''|² dt through waypoints, at rest at both ends.

    The motion is a quintic between waypoints, and C⁴ at the inner waypoints. Velocity
    and acceleration are zero at both ends, so that it is C² together with the rest
    before and after. One dense linear system is solved: the unknowns are velocity and
    acceleration at the inner waypoints, the equations continuity of jerk and snap
    there.

    References:
        T. Flash, N. Hogan, "The coordination of arm movements: an experimentally
        confirmed mathematical model", Journal of Neuroscience 5(7), 1985.
    """

    points: ClassVar[tuple[str, ...]] = ("waypoints",)

    waypoints: Matrix
    """At least two points, shape (m, n) [m, or the task's unit]."""
    times: Vector
    """Times of the waypoints, increasing, shape (m,) [s]."""

    def _pieces(self) -> Pieces:
        x = np.asarray(self.waypoints)
        t = checks.waypoint_times(self.times, len(x))
        # states[i] = (x, x', x'') at waypoint i
        states = np.zeros((len(x), 3, x.shape[1]))
        states[:, 0] = x
        states[1:-1, 1:] = _inner_rates(x, np.diff(t))
        scales = np.diff(t)[:, np.newaxis] ** [0, 1, 2, 0, 1, 2]  # d/dt to d/du
        ends = np.concatenate([states[:-1], states[1:]], axis=1)
        return join(t, QUINTIC @ (scales[..., np.newaxis] * ends), x[-1])


def _inner_rates(x: Array, widths: Array) -> Array:
    """Return x' and x'' at the inner waypoints, shape (m - 2, 2, n)."""
    m, n = x.shape
    powers = np.array([0, 1, 2, 0, 1, 2]) - np.array([[3], [4]])  # d/du to d/dt
    # A (x, x', x'' at every waypoint) = 0: jerk and snap before minus those after
    A = np.zeros((m - 2, 2, m, 3))
    for i in range(m - 2):
        for segment, rows, sign in ((i, _END, 1.0), (i + 1, _START, -1.0)):
            block = sign * rows * widths[segment] ** powers
            A[i, :, segment : segment + 2] += block.reshape(2, 2, 3)
    given = np.einsum("rsi,ij->rsj", A[..., 0], x).reshape(2 * (m - 2), n)
    unknown = A[:, :, 1:-1, 1:].reshape(2 * (m - 2), 2 * (m - 2))
    return np.linalg.solve(unknown, -given).reshape(m - 2, 2, n)
