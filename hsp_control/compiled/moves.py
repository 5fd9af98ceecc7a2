"""What moves a state: valid numbers are copied, then calls are made; and equal steps.

`native_move` does the same where calls are native; `step_plan` chooses.
"""

from collections.abc import Callable, Sequence
from math import ceil
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import kernel

REFUSED = -1.0
"""What a move returns if it was refused; kernels' results are not negative."""

Move = Callable[[float, Array, Array], float]
"""(t, q, v) ↦ what the last of its calls returned, or `REFUSED`."""

Memory = tuple[Array, Array, Array, Indices, Indices]
"""Where t, q and v are kept, shape (1,), (nq,) and (nv,); start and size of what in q
has norm 1, shape (k, 2); and the number of moves, shape (1,)."""


@kernel
def copy_valid(
    t: float,
    q_in: Array,
    v_in: Array,
    time: Array,
    q: Array,
    v: Array,
    unit_blocks: Indices,
    stamp: Indices,
) -> bool:
    """Copy t, q and v if all are finite, of the right sizes and norms; return whether.

    The arguments from ``time`` on are a `Memory`.
    """
    if q_in.shape[0] != q.shape[0] or v_in.shape[0] != v.shape[0]:
        return False
    total = t
    for i in range(q.shape[0]):
        total += q_in[i]
    for i in range(v.shape[0]):
        total += v_in[i]
    ok = np.isfinite(total)
    for k in range(unit_blocks.shape[0]):
        square = 0.0
        for i in range(unit_blocks[k, 0], unit_blocks[k, 0] + unit_blocks[k, 1]):
            square += q_in[i] * q_in[i]
        ok = ok and abs(square - 1.0) < 2e-6
    if ok:
        time[0] = t
        for i in range(q.shape[0]):
            q[i] = q_in[i]
        for i in range(v.shape[0]):
            v[i] = v_in[i]
        stamp[0] += 1
    return bool(ok)


def move(memory: Memory, t: float, q: Array, v: Array) -> float:
    """Copy t, q and v."""
    return 0.0 if copy_valid(t, q, v, *memory) else REFUSED


def move_and_call(
    first: Move, calls: Sequence[Callable[[float], Any]], t: float, q: Array, v: Array
) -> float:
    """Move, then make calls."""
    value = first(t, q, v)
    if value != REFUSED:
        for call in calls:
            value = call(t)
    return value if isinstance(value, float) else 0.0  # what Pinocchio returns


def number_of_steps(duration: float, step: float) -> int:
    """Return the smallest number of equal steps that are not longer than ``step``."""
    return max(1, ceil(duration / step - 1e-9))


def make_steps(
    calls: Sequence[Callable[[float], Any]],
    interval: Array,
    longest: float,
    now: Array,
    h: Array,
) -> None:
    """Divide an interval into equal steps, and make the calls of each."""
    t, end = interval
    steps = number_of_steps(end - t, longest)
    h[0] = (end - t) / steps
    for k in range(steps):
        now[0] = t + k * h[0]
        for call in calls:
            call(now[0])
