"""All steps of an interval of time as one native call."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.adapters import run
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.common.native import NativeCall
from hsp_control.robot.step_count import number_of_steps

_count = kernel(number_of_steps)


def bind_steps(
    calls: Sequence[NativeCall], interval: Array, longest: float, h: Array
) -> NativeCall:
    """Return a call that divides an interval into equal steps, and makes them.

    Args:
        calls: The calls of a step, each of its first instant [s].
        interval: Its beginning and its end [s], shape (2,).
        longest: The longest step [s].
        h: Written: the step [s], shape (1,).
    """
    rows, when = (np.concatenate([c.args[k] for c in calls]) for k in (0, 1))
    call = NativeCall.of(_steps, (rows, when, interval, longest, h), timed=False)
    call.recipe = bind_steps, (calls, interval, longest, h)
    call.kept = rows, when  # it knows their addresses alone
    return call


@kernel
def _steps(
    calls: Indices, when: Array, interval: Array, longest: float, h: Array
) -> None:
    """Make the steps; see `bind_steps`."""
    t, duration = interval[0], interval[1] - interval[0]
    steps = _count(duration, longest)
    h[0] = duration / steps
    for k in range(steps):
        run(calls, when, t + k * h[0])
