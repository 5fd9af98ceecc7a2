"""A low-pass on the measured velocity."""

from math import exp, pi, sqrt, tan

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import RemedyError
from hsp_control.remedies.checks import positive


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
            RemedyError: If the cut-off is not positive, or the order another.
        """
        self.cutoff = positive(cutoff, "cutoff")
        if order not in (1, 2):
            raise RemedyError(f"order is {order!r}; must be 1 or 2")
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
            RemedyError: If the sampling is too slow for the filter.
        """
        if self._past is None:
            self._past = tuple(v.copy() for _ in range(2 * self.order))
            return self._past[0].copy()
        if self.order == 1:
            share = 1.0 - exp(-2.0 * pi * self.cutoff * period)
            passed = self._past[0] + share * (v - self._past[0])
            self._past = passed, self._past[0]
            return np.array(passed)
        # The bilinear transform of 1/(1 + √2 s + s²), with the cut-off where it was.
        check_order_two(self.cutoff, period)
        w = tan(pi * self.cutoff * period)
        scale = 1.0 + sqrt(2.0) * w + w * w
        in1, in2, out1, out2 = self._past
        passed = (
            w * w * (v + 2.0 * in1 + in2)
            - 2.0 * (w * w - 1.0) * out1
            - (1.0 - sqrt(2.0) * w + w * w) * out2
        ) / scale
        self._past = v.copy(), in1, passed, out1
        return passed.copy()


def check_order_two(cutoff: float, period: float) -> None:
    """Refuse what no filter of second order can do at a period [s].

    Raises:
        RemedyError: If the cut-off [Hz] is not below half of the rate.
    """
    if cutoff * period >= 0.5:
        raise RemedyError(
            f"cutoff is {cutoff:g} Hz; at a period of {period:g} s a filter of second "
            f"order needs less than {0.5 / period:g} Hz, half of the rate"
        )
