"""A step in which no limit is violated, as native calls that a compiled loop makes."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import NativeCall, are_native
from hsp_control.control.actuation.actuation import LOOK
from hsp_control.robot.native_move import NativeMove
from hsp_control.robot.robot import Move


class FreeStep(NamedTuple):
    """What `compute` and `applied` of a controller do where no limit is violated."""

    # (t, q, v) ↦ a number that `is_free` understands; the effort and the acceleration
    # are written
    move: NativeMove
    effort: Array  # M a + N, shape (nv,) [N·m or N]
    # calls of the time that record that this effort is held from now on, for the period
    # of the last `Controller.applied`
    sending: Sequence[NativeCall]


def free_step(
    move: Move, effort: Array, sending: Sequence[Callable[[float], Any]]
) -> FreeStep | None:
    """Return a free step of these parts; None where one of them is not native."""
    if not isinstance(move, NativeMove) or not are_native(sending):
        return None
    return FreeStep(move, effort, sending)


@kernel
def is_free(value: float) -> bool:
    """Return whether what a move returned means: valid, finite, no limit violated."""
    return 0.0 <= value < LOOK
