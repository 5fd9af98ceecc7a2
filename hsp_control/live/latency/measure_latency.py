"""Measure the latency of a control loop and of an empty loop in real time."""

from collections.abc import Callable
from time import perf_counter_ns

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.live.latency.control_loop import ControlLoop
from hsp_control.live.latency.periodic import StepTimes, run_periodic
from hsp_control.live.latency.real_time import no_garbage_collection, real_time_priority
from hsp_control.live.latency.report import Latency

TURN = 2.0
"""How long each loop runs before the other one has its turn [s]: disturbances of the
machine vary with time, and both loops must see the same ones."""

MAX_PERIODS = 100_000_000
"""Largest number of periods, all stored in memory: a day at 1 kHz."""


def measure(
    loop: ControlLoop,
    seconds: float,
    *,
    priority: int | None = None,
    on_progress: Callable[[float], None] | None = None,
) -> Latency:
    """Measure a loop in real time, and an empty loop for the same time, in turns.

    Before, the same steps are executed in a dry run. Controller and plant have no
    memory except the state, so that the dry run compiles, loads and allocates
    everything that the real-time steps need.

    Args:
        loop: The controller and its robot, at its start.
        seconds: How long each of the two loops runs [s].
        priority: Real-time priority (SCHED_FIFO) of both, 1 to 99; None: ordinary
            scheduling.
        on_progress: Called with the fraction done, between turns.

    Returns:
        The times; after Ctrl-C, those measured until then.

    Raises:
        SimulationError: If the time is not valid, the motion diverges, or the priority
            cannot be set.
    """
    count = _periods(loop, seconds)
    with real_time_priority(priority):
        pass  # raise at once if it cannot be set
    turn = max(1, round(TURN / loop.period))
    period = round(loop.period * 1e9)
    from numba.core import event

    control, empty = StepTimes(period, count), StepTimes(period, count)
    # With ordinary priority: Linux throttles real-time processes that never sleep.
    back_to_back = dry_run(loop, seconds)
    with (
        no_garbage_collection(),
        real_time_priority(priority),
        event.install_recorder("numba:compile") as compiled,
    ):
        try:
            while control.steps < count:
                steps = min(turn, count - control.steps)
                run_periodic(loop.control, loop.move, control, steps)
                run_periodic(_nothing, _nothing, empty, steps)
                if on_progress is not None:
                    on_progress(control.steps / count)
        except KeyboardInterrupt:
            if not empty.steps:
                raise
        compilations = sum(each.is_start for _, each in compiled.buffer)
    return Latency(control, empty, back_to_back, compilations)


def dry_run(loop: ControlLoop, seconds: float) -> Array:
    """Run the steps as fast as possible, without real time; return to the start.

    Args:
        loop: The controller and its robot.
        seconds: Duration in the loop's own time [s].

    Returns:
        Execution time of each step, shape (N,) [s].

    Raises:
        SimulationError: If the time is not valid, or the motion diverges.
    """
    count = _periods(loop, seconds)
    step_times = np.zeros(count)
    loop.restart()
    for k in range(count):
        start = perf_counter_ns()
        loop.control()
        step_times[k] = (perf_counter_ns() - start) * 1e-9
        loop.move()
    loop.restart()
    return step_times


def _periods(loop: ControlLoop, seconds: float) -> int:
    if not 0.0 < seconds <= MAX_PERIODS * loop.period:
        raise SimulationError(
            f"{seconds:g} s; must be positive, and {MAX_PERIODS} periods at most"
        )
    return max(1, round(seconds / loop.period))


def _nothing() -> None:
    pass
