"""What a loop against the clock should do to its own process."""

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

from hsp_control.common.exceptions import SimulationError


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Keep Python's garbage collector away while the context lasts.

    A collection visits every container object there is: milliseconds, at a time of its
    own choosing. A control step makes no reference cycles, so nothing piles up that
    reference counting does not free. What exists already is frozen: should something
    collect in spite of all, it has little to look at.
    """
    was_enabled = gc.isenabled()
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        gc.unfreeze()
        if was_enabled:
            gc.enable()


@contextmanager
def real_time_priority(level: int) -> Iterator[None]:
    """Let the process go before all ordinary ones (SCHED_FIFO) while the context lasts.

    Args:
        level: 1 to 99; drivers' threads have 50 on a real-time kernel.

    Raises:
        SimulationError: If the level is none, or the user may not: that takes root, the
            capability CAP_SYS_NICE, or a line ``rtprio`` in limits.conf.
    """
    if not 1 <= level <= 99:
        raise SimulationError(f"real-time priority {level}; must be from 1 to 99")
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(level))
    except OSError as error:
        raise SimulationError(
            f"real-time priority {level}: {error.strerror}; it takes root, "
            "CAP_SYS_NICE, or a line 'rtprio' in /etc/security/limits.conf"
        ) from None
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, parameters)
