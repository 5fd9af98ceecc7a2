"""Do something once a period, and write down when it happened."""

from collections.abc import Callable
from time import perf_counter_ns, sleep

import numpy as np
from numpy.typing import NDArray

Nanoseconds = NDArray[np.int64]


class Record:
    """When the steps of a loop began and ended; room for a known number of them.

    Attributes:
        period: Length of a period [ns].
        steps: How many there are so far.
        wake: How long after the period's beginning the loop was awake [ns].
        step: How long the step took [ns].
    """

    def __init__(self, period: int, capacity: int) -> None:
        """Allocate, and touch every page of it: the loop shall find it in memory."""
        self.period = period
        self.steps = 0
        self.wake: Nanoseconds = np.full(capacity, -1, dtype=np.int64)
        self.step: Nanoseconds = np.full(capacity, -1, dtype=np.int64)


def run_clocked(
    step: Callable[[], None], after: Callable[[], None], record: Record, count: int
) -> None:
    """Run a number of periods, whose beginnings are fixed before the first.

    A late step does not shift those after it: they begin at once until it is made up
    for, as a fieldbus would have it.

    Args:
        step: What is timed.
        after: What happens in the rest of the period, and is not.
        record: Where to write.
        count: How many periods; the record has room.
    """
    clock, pause = perf_counter_ns, sleep
    wake, took, period, first = record.wake, record.step, record.period, record.steps
    begin = clock() + period
    for k in range(first, first + count):
        now = clock()
        if now < begin:
            pause((begin - now) * 1e-9)
        awake = clock()
        step()
        done = clock()
        wake[k] = awake - begin
        took[k] = done - awake
        record.steps = k + 1
        begin += period
        after()
