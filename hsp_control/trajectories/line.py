"""A straight line from rest to rest."""

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import PiecewisePolynomial
from hsp_control.trajectories.polynomial import QUINTIC


class Line(PiecewisePolynomial):
    """x(t) = x0 + s (x1 - x0), with s the `smooth_step` from rest to rest.

    It is C², holds x0 before and x1 after; its peak speed is 1.875 |x1 - x0| / T.
    `UniformLine` is the one of constant speed.
    """

    __slots__ = ()

    def __init__(
        self,
        start: ArrayLike,
        end: ArrayLike,
        duration: float,
        start_time: float = 0.0,
    ) -> None:
        """Lead from ``start`` to ``end``.

        Args:
            start: x0, shape (n,).
            end: x1, shape (n,).
            duration: T > 0 [s].
            start_time: When it leaves [s].
        """
        x0 = checks.array(start, "start", (None,))
        x1 = checks.array(end, "end", x0.shape)
        t0 = checks.number(start_time, "start_time")
        t1 = t0 + checks.positive(duration, "duration")
        rest = np.zeros_like(x0)
        coefficients = QUINTIC @ np.stack([x0, rest, rest, x1, rest, rest])
        super().__init__([t0, t1], coefficients[np.newaxis], x1)
