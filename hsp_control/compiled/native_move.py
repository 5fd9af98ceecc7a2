"""A state's move, or all steps of an interval of time, as one native call."""

from collections.abc import Callable, Sequence
from functools import cache, partial
from typing import Self

from numba import types

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.adapters import entry_point, run
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.moves import REFUSED, Memory, copy_valid, number_of_steps
from hsp_control.compiled.native import NativeCall, rows_of


class NativeMove(partial[float]):
    """Copies valid t, q and v, and makes native calls; see `moves.move`."""

    calls: Sequence[NativeCall]  # the calls, which own the memory of their arguments

    @classmethod
    def of(cls, calls: Sequence[NativeCall], memory: Memory) -> Self:
        """Put the calls' rows together."""
        move = cls(_entry(), rows_of(calls), *memory)
        move.calls = calls
        return move


@kernel
def make_move(
    calls: Indices,
    time: Array,
    q: Array,
    v: Array,
    unit_blocks: Indices,
    stamp: Indices,
    t: float,
    q_in: Array,
    v_in: Array,
) -> float:
    """Copy t, q and v and make the calls; see `NativeMove`."""
    if not copy_valid(t, q_in, v_in, time, q, v, unit_blocks, stamp):
        return REFUSED
    return run(calls, t)


@cache
def _entry() -> Callable[..., float]:
    own, table = types.float64[::1], types.int64[:, ::1]
    given = types.float64[:]  # with any strides
    memory = own, own, own, table, types.int64[::1]
    kinds = table, *memory, types.float64, given, given
    entry: Callable[..., float] = entry_point(make_move, kinds)
    return entry


_count = kernel(number_of_steps)


@kernel
def make_steps(
    calls: Indices, interval: Array, longest: float, now: Array, h: Array
) -> None:
    """Divide an interval into equal steps, and make the calls of each."""
    t, duration = interval[0], interval[1] - interval[0]
    steps = _count(duration, longest)
    h[0] = duration / steps
    for k in range(steps):
        now[0] = t + k * h[0]
        run(calls, now[0])
