"""A low-pass on the measured velocity."""

from math import exp, pi, sqrt, tan

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.control.compensation.checks import positive


class VelocityFilter:
    """Butterworth's low-pass of first or second order, on each freedom's velocity.

    What passes is late by 1/(2π f) at the first order and √2 times that at the second:
    the check of the rate counts it. It begins in balance with the first measurement.

    Attributes:
        cutoff: Where half of the power passes [Hz].
        order: 1 or 2.
    """

    def __init__(self, cutoff: float, order: int = 1) -> None:
        """Set the filter.

        Args:
            cutoff: f > 0 [Hz].
            order: 1 or 2.

        Raises:
            CompensationError: If the cut-off is not positive, or the order another.
        """
        self.cutoff = positive(cutoff, "cutoff")
        if order not in (1, 2):
            raise CompensationError(f"order is {order!r}; must be 1 or 2")
        self.order = int(order)

    @property
    def lateness(self) -> float:
        """By how much slow motion comes late [s]."""
        return (1.0 if self.order == 1 else sqrt(2.0)) / (2.0 * pi * self.cutoff)

    def restart(self) -> None:
        """Forget what was measured."""
        self._past: tuple[Array, ...] | None = None

    def apply(self, v: Array, period: float) -> Array:
        """Return what passes of a velocity, shape (nv,), in an array of its own.

        Args:
            v: As measured, shape (nv,).
            period: Time since the last measurement [s].

        Raises:
            CompensationError: If the sampling is too slow for the filter.
        """
        if self._past is None:
            self._past = tuple(v.copy() for _ in range(4))
            return v.copy()
        passed, self._past = self.step(v, self._past, period)
        return passed.copy()

    def step(
        self, v: Array, past: tuple[Array, ...], period: float
    ) -> tuple[Array, tuple[Array, ...]]:
        """Return what passes, and the past that the next step is to be given.

        Args:
            v: Input, of any shape.
            past: The last two inputs and the last two outputs, each the latest first.
            period: Time since the last input [s].
        """
        b, a = self.coefficients(period)
        in1, in2, out1, out2 = past
        out = b[0] * v + b[1] * in1 + b[2] * in2 - a[0] * out1 - a[1] * out2
        return out, (np.array(v), in1, out, out1)

    def coefficients(
        self, period: float
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return b_0..b_2 and a_1, a_2 of y_k = Σ b_i v_(k-i) - Σ a_i y_(k-i).

        The first order is exact for a velocity that is held; the second is the bilinear
        transform of 1/(1 + √2 s + s²), with the cut-off where it was.

        Raises:
            CompensationError: If a cut-off of second order is not below half the rate.
        """
        if self.order == 1:
            kept = exp(-2.0 * pi * self.cutoff * period)
            return (1.0 - kept, 0.0, 0.0), (-kept, 0.0)
        if self.cutoff * period >= 0.5:
            raise CompensationError(
                f"cutoff is {self.cutoff:g} Hz; at a period of {period:g} s a filter "
                f"of second order needs less than {0.5 / period:g} Hz, half of the rate"
            )
        w = tan(pi * self.cutoff * period)
        scale = 1.0 + sqrt(2.0) * w + w * w
        b = w * w / scale
        a = 2.0 * (w * w - 1.0) / scale, (1.0 - sqrt(2.0) * w + w * w) / scale
        return (b, 2.0 * b, b), a
