"""What was measured, in the numbers that matter to a loop."""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.latency.clocked import Nanoseconds, Record


class Quantiles(NamedTuple):
    """A distribution of times [s].

    Attributes:
        median: As often exceeded as not.
        p99: Exceeded by one of a hundred.
        p999: Exceeded by one of a thousand.
        worst: Never exceeded.
    """

    median: float
    p99: float
    p999: float
    worst: float

    @classmethod
    def of(cls, times: Array) -> Self:
        """Return those of times [s], shape (N,): each is one that was measured."""
        found = np.quantile(times, [0.5, 0.99, 0.999, 1.0], method="higher")
        return cls(*map(float, found))


class Latency:
    """Times of a controlling loop and of an empty one, measured in turns.

    Attributes:
        period: Length of a period [s].
        step: How long state update and law took, shape (N,) [s].
        wake: How long after its period's beginning the loop was awake, shape (N,) [s].
        empty: The same of the loop that does nothing, shape (M,) [s].
        back_to_back: How long steps took in the rehearsal, without sleep between [s].
        compilations: How many kernels were compiled on the clock: none should be.
    """

    def __init__(
        self, control: Record, empty: Record, back_to_back: Array, compilations: int
    ) -> None:
        """Take what whole periods say."""
        self.period = control.period * 1e-9
        self.step = _seconds(control.step[: control.steps])
        self.wake = _seconds(control.wake[: control.steps])
        self.empty = _seconds(empty.wake[: empty.steps])
        self.back_to_back = back_to_back
        self.compilations = compilations

    @property
    def response(self) -> Array:
        """From each period's beginning to its effort, shape (N,) [s]."""
        return self.wake + self.step

    @property
    def missed(self) -> int:
        """How many efforts came after the end of their period."""
        return int((self.response > self.period).sum())

    @property
    def empty_missed(self) -> int:
        """How many periods the empty loop slept through: the machine's own share."""
        return int((self.empty > self.period).sum())


def _seconds(times: Nanoseconds) -> Array:
    return np.asarray(times * 1e-9, dtype=np.float64)
