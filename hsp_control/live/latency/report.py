"""The measured latencies of a control loop."""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.latency.periodic import Nanoseconds, StepTimes


class Quantiles(NamedTuple):
    """Quantiles of a distribution of times [s].

    Attributes:
        median: 50 % quantile.
        p99: 99 % quantile.
        p999: 99.9 % quantile.
        worst: Maximum.
    """

    median: float
    p99: float
    p999: float
    worst: float

    @classmethod
    def of(cls, times: Array) -> Self:
        """Return the quantiles of times [s], shape (N,); each is one of the times."""
        found = np.quantile(times, [0.5, 0.99, 0.999, 1.0], method="higher")
        return cls(*map(float, found))


class Latency:
    """Times of a control loop and of an empty loop, measured in turns.

    Attributes:
        period: Length of a period [s].
        step: Execution time of state update and controller, shape (N,) [s].
        wake: Wake-up latency, from the period's beginning, shape (N,) [s].
        empty: Wake-up latency of the empty loop, shape (M,) [s].
        back_to_back: Execution time of the steps in the dry run, without sleep between
            them, shape (N,) [s].
        compilations: Number of kernels that were compiled in real time: should be 0.
    """

    def __init__(
        self,
        control: StepTimes,
        empty: StepTimes,
        back_to_back: Array,
        compilations: int,
    ) -> None:
        """Convert the recorded times to seconds."""
        self.period = control.period * 1e-9
        self.step = _seconds(control.step[: control.steps])
        self.wake = _seconds(control.wake[: control.steps])
        self.empty = _seconds(empty.wake[: empty.steps])
        self.back_to_back = back_to_back
        self.compilations = compilations

    @property
    def response(self) -> Array:
        """Response times, from period begin to effort, shape (N,) [s]."""
        return self.wake + self.step

    @property
    def missed(self) -> int:
        """Number of deadline misses: efforts after the end of their period."""
        return int((self.response > self.period).sum())

    @property
    def empty_missed(self) -> int:
        """Number of deadline misses of the empty loop: caused by the machine alone."""
        return int((self.empty > self.period).sum())


def _seconds(times: Nanoseconds) -> Array:
    return np.asarray(times * 1e-9, dtype=np.float64)
