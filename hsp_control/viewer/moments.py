"""Between the rows of a log: what it would have recorded at any time."""

from typing import NamedTuple

import numpy as np

from hsp_control.arrays import Array


class Moment(NamedTuple):
    """A time between two rows of a log.

    Attributes:
        row: The row before.
        fraction: How far it is to the next, from 0 to 1.
    """

    row: int
    fraction: float


def moment(t: Array, time: float) -> Moment:
    """Return the moment at a time [s], within the rows' times ``t`` of shape (N,)."""
    row = int(np.clip(np.searchsorted(t, time, side="right") - 1, 0, len(t) - 1))
    if row == len(t) - 1 or time <= t[row]:
        return Moment(row, 0.0)
    return Moment(row, float((time - t[row]) / (t[row + 1] - t[row])))


def between(column: Array, now: Moment) -> Array:
    """Return a column's value at a moment, on the line between two rows."""
    row, fraction = now
    here: Array = column[row]
    if fraction == 0.0:
        return here
    return (1.0 - fraction) * here + fraction * column[row + 1]
