"""A straight line from rest to rest."""

from dataclasses import KW_ONLY
from typing import ClassVar

import numpy as np

from hsp_control.declaration.quantities import Number, Positive, Vector
from hsp_control.trajectories import checks
from hsp_control.trajectories.piecewise_polynomial import (
    Pieces,
    PolynomialTrajectory,
    join,
)
from hsp_control.trajectories.polynomial import QUINTIC


class Line(PolynomialTrajectory, type="line"):
    """x(t) = x0 + s (x1 - x0), with s the `smooth_step` from rest to rest.

    C². It rests at x0 before and at x1 after; the peak speed is 1.875 |x1 - x0| / T.
    For a line of constant speed use `UniformLine`.
    """

    points: ClassVar[tuple[str, ...]] = ("start", "end")

    end: Vector
    """x1, shape (n,) [m, or the task's unit]."""
    duration: Positive
    """T [s]."""
    _: KW_ONLY
    start: Vector | None = None
    """x0, shape (n,) [m, or the task's unit]; where the robot starts by default."""
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return np.size(self.end)

    def _pieces(self) -> Pieces:
        x0 = checks.array(np.asarray(self.start), "start", (None,))
        x1 = checks.array(self.end, "end", x0.shape)
        rest = np.zeros_like(x0)
        coefficients = QUINTIC @ np.stack([x0, rest, rest, x1, rest, rest])
        times = [self.start_time, self.start_time + self.duration]
        return join(times, coefficients[np.newaxis], x1)
