"""Run a function once a period in real time, and record its times."""

from collections.abc import Callable
from time import perf_counter_ns, sleep

import numpy as np
from numpy.typing import NDArray

Nanoseconds = NDArray[np.int64]


class StepTimes:
    """Wake-up latencies and execution times of a loop's steps.

    Attributes:
        period: Length of a period [ns].
        steps: Number of steps recorded so far.
        wake: From the beginning of the period to the wake-up, shape (capacity,) [ns].
        step: Execution time of the step, shape (capacity,) [ns].
    """

    def __init__(self, period: int, capacity: int) -> None:
        """Allocate the memory and write to all of it, to avoid page faults later."""
        self.period = period
        self.steps = 0
        self.wake: Nanoseconds = np.full(capacity, -1, dtype=np.int64)
        self.step: Nanoseconds = np.full(capacity, -1, dtype=np.int64)


def run_periodic(
    step: Callable[[], None], after: Callable[[], None], times: StepTimes, count: int
) -> None:
    """Run a number of periods; their beginnings are fixed before the first one.

    An overrun does not shift the later periods: they begin without sleep until the loop
    is on time again, as on a fieldbus.

    Args:
        step: Called once a period, and timed.
        after: Called in the rest of the period, not timed.
        times: Receives the times; must have space for them.
        count: Number of periods.
    """
    clock, pause = perf_counter_ns, sleep
    wake, step_time, period, first = times.wake, times.step, times.period, times.steps
    begin = clock() + period
    for k in range(first, first + count):
        now = clock()
        if now < begin:
            pause((begin - now) * 1e-9)
        awake = clock()
        step()
        done = clock()
        wake[k] = awake - begin
        step_time[k] = done - awake
        times.steps = k + 1
        begin += period
        after()
