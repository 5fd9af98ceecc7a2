"""Run a loop against the clock, beside an empty one."""

from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from time import perf_counter_ns

import numpy as np
from numba.core import event

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.live.latency.clocked import Record, run_clocked
from hsp_control.live.latency.control_loop import ControlLoop
from hsp_control.live.latency.quiet import no_garbage_collection, real_time_priority
from hsp_control.live.latency.report import Latency

TURN = 2.0
"""How long [s] each loop runs before the other has its turn: the machine's noise comes
and goes, and both shall see the same."""


MOST_PERIODS = 100_000_000
"""All are kept in memory: a day at 1 kHz."""


def measure(
    loop: ControlLoop,
    seconds: float,
    *,
    priority: int | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Latency:
    """Measure a loop against the clock for a time, and an empty one for as long.

    Before that the very same steps are run off the clock. Law and plant have no memory
    but the state, so that nothing is left to be compiled, loaded or allocated on the
    clock which the rehearsal did not meet.

    Args:
        loop: The controller and its robot, at its start.
        seconds: How long each of the two loops runs [s].
        priority: Real-time priority of both; None: that of all processes.
        on_progress: Called with the fraction done, between turns.

    Returns:
        What was measured; after Ctrl-C, what was until then.

    Raises:
        SimulationError: If the time is not one, the motion diverges in it, or the
            priority is refused.
    """
    count = _periods(loop, seconds)
    with _priority(priority):
        pass  # what is refused is refused at once
    turn = max(1, round(TURN / loop.period))
    period = round(loop.period * 1e9)
    control, empty = Record(period, count), Record(period, count)
    # Without priority: Linux stops real-time processes that do not sleep.
    back_to_back = rehearse(loop, seconds)
    with (
        no_garbage_collection(),
        _priority(priority),
        event.install_recorder("numba:compile") as compiled,
    ):
        try:
            while control.steps < count:
                steps = min(turn, count - control.steps)
                run_clocked(loop.control, loop.move, control, steps)
                run_clocked(_nothing, _nothing, empty, steps)
                if on_progress is not None:
                    on_progress(control.steps / count)
        except KeyboardInterrupt:
            if not empty.steps:
                raise
        compilations = sum(each.is_start for _, each in compiled.buffer)
    return Latency(control, empty, back_to_back, compilations)


def rehearse(loop: ControlLoop, seconds: float) -> Array:
    """Run the steps to come as fast as they go, off the clock, and return to the start.

    Args:
        loop: The controller and its robot.
        seconds: Of the loop's own time [s].

    Returns:
        How long each step took [s].

    Raises:
        SimulationError: If the time is not one, or the motion diverges in it.
    """
    count = _periods(loop, seconds)
    took = np.zeros(count)
    loop.restart()
    for k in range(count):
        start = perf_counter_ns()
        loop.control()
        took[k] = (perf_counter_ns() - start) * 1e-9
        loop.move()
    loop.restart()
    return took


def _priority(level: int | None) -> AbstractContextManager[None]:
    return nullcontext() if level is None else real_time_priority(level)


def _periods(loop: ControlLoop, seconds: float) -> int:
    if not 0.0 < seconds <= MOST_PERIODS * loop.period:
        raise SimulationError(
            f"{seconds:g} s; must be positive, and {MOST_PERIODS} periods at most"
        )
    return max(1, round(seconds / loop.period))


def _nothing() -> None:
    pass
