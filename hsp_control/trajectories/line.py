"""A straight line from rest to rest."""

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import PiecewisePolynomial
from hsp_control.trajectories.polynomial import QUINTIC


class Line(PiecewisePolynomial):
    """x(t) = x0 + s (x1 - x0), with s the `smooth_step` from rest to rest.

    C². It rests at x0 before and at x1 after; the peak speed is 1.875 |x1 - x0| / T.
    For a line of constant speed use `UniformLine`.
    """

    __slots__ = ()

    def __init__(
        self,
        start: ArrayLike,
        end: ArrayLike,
        duration: float,
        start_time: float = 0.0,
    ) -> None:
        """Set the line.

        Args:
            start: x0, shape (n,).
            end: x1, shape (n,).
            duration: T > 0 [s].
            start_time: Start of the motion [s].

        Raises:
            TrajectoryError: If a shape does not fit, a value is not finite, or the
                duration is not positive.
        """
        x0 = checks.array(start, "start", (None,))
        x1 = checks.array(end, "end", x0.shape)
        t0 = checks.number(start_time, "start_time")
        t1 = t0 + checks.positive(duration, "duration")
        rest = np.zeros_like(x0)
        coefficients = QUINTIC @ np.stack([x0, rest, rest, x1, rest, rest])
        super().__init__([t0, t1], coefficients[np.newaxis], x1)
