"""Between the rows of a log: what it would have recorded at any time."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot


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
    there: Array = column[row + 1]
    return (1.0 - fraction) * here + fraction * there


def orientation_between(quaternions: Array, now: Moment) -> pin.Quaternion:
    """Return the orientation at a moment, the short way from row to row.

    Args:
        quaternions: One a row, (x, y, z, w), shape (N, 4).
        now: The moment.
    """
    row, fraction = now
    start, end = (
        pin.Quaternion(*quaternions[k, [3, 0, 1, 2]]).normalized()
        for k in (row, min(row + 1, len(quaternions) - 1))
    )
    return start.slerp(fraction, end)


def configuration_between(robot: Robot, q: Array, now: Moment) -> Array:
    """Return the configuration at a moment, on the shortest way from row to row.

    Args:
        robot: The robot.
        q: One configuration a row, shape (N, nq).
        now: The moment.
    """
    row, fraction = now
    here: Array = q[row]
    if fraction == 0.0:
        return here
    return robot.integrate(here, fraction * robot.difference(here, q[row + 1]))
