"""A low-pass filter of the measured velocity."""

from collections.abc import Callable
from math import exp, pi, sqrt, tan
from typing import Literal

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import CompensationError
from hsp_control.control.compensation.stage import Alone, AloneCalls, Run, Stage
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Positive
from hsp_control.engine.plans import PartCall, planned


class VelocityFilter(Part, error=CompensationError):
    """A Butterworth low-pass filter of the measured velocity.

    It filters the degrees of freedom independently. It delays slow motion by 1/(2π f)
    at first order, and by √2 times that at second order; `check_rate` takes this into
    account. Its initial state is the steady state for the first measurement.
    """

    cutoff: Positive
    """Cut-off frequency f, at which half of the power passes [Hz]."""
    order: Literal[1, 2] = 1
    """Order of the filter [-]."""

    @property
    def delay(self) -> float:
        """The delay of slow motion [s]."""
        return (1.0 if self.order == 1 else sqrt(2.0)) / (2.0 * pi * self.cutoff)

    def step(
        self, v: Array, past: tuple[Array, ...], period: float
    ) -> tuple[Array, tuple[Array, ...]]:
        """Return the output for an input, and ``past`` for the next step."""
        b, a = self.coefficients(period)
        in1, in2, out1, out2 = past
        out = b[0] * v + b[1] * in1 + b[2] * in2 - a[0] * out1 - a[1] * out2
        return out, (np.array(v), in1, out, out1)

    def coefficients(
        self, period: float
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Return b_0..b_2 and a_1, a_2 of y_k = Σ b_i v_(k-i) - Σ a_i y_(k-i)."""
        # The first order is exact for a piecewise constant velocity. The second is the
        # bilinear transform of 1/(1 + √2 s + s²), prewarped to keep the cut-off.
        if self.order == 1:
            pole = exp(-2.0 * pi * self.cutoff * period)
            return (1.0 - pole, 0.0, 0.0), (-pole, 0.0)
        if self.cutoff * period >= 0.5:
            raise CompensationError(
                f"cutoff is {self.cutoff:g} Hz; at a period of {period:g} s a second-"
                f"order filter needs less than {0.5 / period:g} Hz, half of the rate"
            )
        w = tan(pi * self.cutoff * period)
        scale = 1.0 + sqrt(2.0) * w + w * w
        b = w * w / scale
        a = 2.0 * (w * w - 1.0) / scale, (1.0 - sqrt(2.0) * w + w * w) / scale
        return (b, 2.0 * b, b), a


class RunningFilter(Stage):
    """A velocity filter in one run: it keeps the last inputs and outputs."""

    _bound: tuple[Array, Callable[[], object]] | None = None

    def __init__(self, declared: VelocityFilter) -> None:
        self._filter = declared
        self._b, self._a = np.zeros(3), np.zeros(2)
        self._begun = np.zeros(1, dtype=np.int64)
        self._past = np.zeros((4, 0))  # the last inputs and outputs, by joint

    def measure(self, run: Run) -> None:
        """Filter the velocity; see `Stage.measure`."""
        run.v = self.apply(np.asarray(run.v, dtype=float), run.last_period)

    def apply(self, v: Array, period: float) -> Array:
        """Return the filtered velocity, a new array of shape (nv,)."""
        if self._bound is None:
            own = np.zeros(len(v))
            self._bound = own, planned([self._call(own)]).call()
        own, filtered = self._bound
        own[:] = v
        if self._begun[0]:
            self._b[:], self._a[:] = self._filter.coefficients(period)
        filtered()
        return own.copy()

    def alone(self, shared: Alone) -> AloneCalls:
        """Return the filter; see `Stage.alone`."""
        self._b[:], self._a[:] = self._filter.coefficients(shared.period.item())
        return AloneCalls(measure=[self._call(shared.v)])

    def _call(self, v: Array) -> PartCall:
        if self._past.shape[1] != len(v):
            self._past = np.zeros((4, len(v)))
        numbers = {"b": self._b, "a": self._a, "past": self._past, "begun": self._begun}
        return PartCall(engine.FilterVelocity, **numbers, v=v)
