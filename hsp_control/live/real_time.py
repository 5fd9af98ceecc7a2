"""Settings of a process that runs a real-time loop."""

import gc
import os
from collections.abc import Iterator
from contextlib import contextmanager

from hsp_control.common.errors import SimulationError


@contextmanager
def no_garbage_collection() -> Iterator[None]:
    """Disable Python's garbage collector in this context.

    A collection takes milliseconds at an unknown time, and a control step creates no
    reference cycles. Existing objects are frozen: an explicit collection skips them.
    If some were frozen before, all stay frozen: they cannot be released separately.
    """
    was_enabled, were_frozen = gc.isenabled(), gc.get_freeze_count() > 0
    gc.collect()
    gc.freeze()
    gc.disable()
    try:
        yield
    finally:
        if not were_frozen:
            gc.unfreeze()
        if was_enabled:
            gc.enable()


@contextmanager
def real_time_priority(level: int | None) -> Iterator[None]:
    """Run the process with real-time priority (SCHED_FIFO) in this context.

    ``level`` is 1 to 99; drivers' threads of a real-time kernel have 50. None: the
    scheduling stays as it is.
    """
    if level is None:
        yield
        return
    if not 1 <= level <= 99:
        raise SimulationError(f"real-time priority {level}; must be from 1 to 99")
    if not hasattr(os, "sched_setscheduler"):  # macOS
        raise SimulationError(f"real-time priority {level}: this system has none")
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(level))
    except OSError as error:
        raise SimulationError(
            f"real-time priority {level}: {error.strerror}; needs root, "
            "CAP_SYS_NICE, or a line 'rtprio' in /etc/security/limits.conf"
        ) from None
    try:
        yield
    finally:
        os.sched_setscheduler(0, policy, parameters)
