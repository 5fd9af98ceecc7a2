"""Polynomials between knots, the base class of lines, splines and minimum jerk."""

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.polynomial import horner
from hsp_control.trajectories.trajectory import Trajectory


class PiecewisePolynomial(Compiled, Trajectory):
    """x(t) = Σ_k c_ik u^k with u = (t - t_i) / (t_{i+1} - t_i) between t_i and t_{i+1}.

    The motion rests exactly at the first point before the first knot, and at the last
    point after the last knot. The coefficients decide how smooth it is at the knots.

    Attributes:
        times: The m knots, increasing, shape (m,) [s].
        waypoints: The points at the knots, shape (m, n).
    """

    __slots__ = ("_coefficients", "times", "waypoints")

    def __init__(
        self,
        times: ArrayLike,
        coefficients: ArrayLike,
        end: ArrayLike | None = None,
    ) -> None:
        """Join m - 1 polynomials at m knots.

        Args:
            times: The knots, increasing, shape (m,) [s].
            coefficients: c, shape (m - 1, degree + 1, n).
            end: The point after the last knot, shape (n,); None: the end of the last
                polynomial, with its rounding error.

        Raises:
            TrajectoryError: If a shape does not fit, a value is not finite, or the
                knots do not increase.
        """
        c = checks.array(coefficients, "coefficients", (None, None, None))
        last = c[-1].sum(axis=0) if end is None else end
        self.times = checks.waypoint_times(times, len(c) + 1)
        self.waypoints = np.vstack([c[:, 0], checks.array(last, "end", c.shape[2:])])
        self._coefficients = c

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return len(self.waypoints[0])

    def _kernel(self) -> Kernel:
        return _evaluate, (self.times, self.waypoints, self._coefficients)


@kernel
def _evaluate(
    times: Array,
    waypoints: Array,
    coefficients: Array,
    position: Array,
    velocity: Array,
    acceleration: Array,
    t: float,
) -> None:
    last = times.size - 1
    if t <= times[0] or t >= times[last]:
        end = 0 if t <= times[0] else last
        for j in range(position.size):
            position[j] = waypoints[end, j]
            velocity[j] = 0.0
            acceleration[j] = 0.0
        return
    i, after = 0, last  # bisection for times[i] <= t < times[i + 1]
    while after - i > 1:
        middle = (i + after) // 2
        if t < times[middle]:
            after = middle
        else:
            i = middle
    width = times[i + 1] - times[i]
    u = (t - times[i]) / width
    horner(u, width, coefficients[i], position, velocity, acceleration)
