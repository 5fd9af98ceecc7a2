"""A state's move, or all steps of an interval of time, as one native call."""

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Self

from numba import types

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.adapters import entry_point, run
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.native import NativeCall, rows_of
from hsp_control.robot.motion import REFUSED, copy_valid, number_of_steps


class NativeMove(partial[float]):
    """Copies valid q and v, and makes native calls; the last result, or `REFUSED`."""

    calls: Sequence[NativeCall]  # the calls, which own the memory of their arguments

    @classmethod
    def of(
        cls,
        calls: Sequence[NativeCall],
        q: Array,
        v: Array,
        unit_blocks: Indices,
        stamp: Indices,
    ) -> Self:
        """Put the calls' rows together."""
        move = cls(_entry(), rows_of(calls), q, v, unit_blocks, stamp)
        move.calls = calls
        return move


@kernel
def move_to(
    calls: Indices,
    q: Array,
    v: Array,
    unit_blocks: Indices,
    stamp: Indices,
    t: float,
    q_in: Array,
    v_in: Array,
) -> float:
    """Copy q and v and make the calls; see `NativeMove`."""
    if not copy_valid(t, q_in, v_in, q, v, unit_blocks, stamp):
        return REFUSED
    return run(calls, t)


@cache
def _entry() -> Callable[..., float]:
    own, table = types.float64[::1], types.int64[:, ::1]
    given = types.float64[:]  # with any strides
    kinds = table, own, own, table, types.int64[::1], types.float64, given, given
    entry: Callable[..., float] = entry_point(move_to, kinds)
    return entry


_count = kernel(number_of_steps)


@kernel
def make_steps(calls: Indices, interval: Array, longest: float, h: Array) -> None:
    """Divide an interval into equal steps [s], and make the calls of each."""
    t, duration = interval[0], interval[1] - interval[0]
    steps = _count(duration, longest)
    h[0] = duration / steps
    for k in range(steps):
        run(calls, t + k * h[0])
