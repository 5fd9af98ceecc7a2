"""A simulation that keeps pace with real time, for what is fed from outside."""

from collections.abc import Callable
from itertools import count
from time import monotonic, sleep

from hsp_control.simulation.recorder import Recorder


def in_real_time(
    period: float, on_row: Callable[[Recorder], None] | None
) -> Callable[[Recorder], None]:
    """Return what `simulate` calls after every row, so that it waits for the clock."""
    rows, begin = count(), monotonic()

    def wait(recorder: Recorder) -> None:
        nonlocal begin
        if on_row is not None:
            on_row(recorder)
        row = next(rows)
        if row == 0:
            begin = monotonic()  # kernels are compiled now
        sleep(max(begin + row * period - monotonic(), 0.0))

    return wait
