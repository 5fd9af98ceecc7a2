"""Interpolation between the rows of a log."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot


class RowPosition(NamedTuple):
    """The position of a time between two rows of a log."""

    row: int  # the row before the time
    fraction: float  # the fraction of the way to the next row, from 0 to 1


def row_position(t: Array, time: float) -> RowPosition:
    """Return where a time lies between the rows of a log; t (N,) [s]."""
    row = int(np.clip(np.searchsorted(t, time, side="right") - 1, 0, len(t) - 1))
    if row == len(t) - 1 or time <= t[row]:
        return RowPosition(row, 0.0)
    return RowPosition(row, float((time - t[row]) / (t[row + 1] - t[row])))


def interpolate_column(column: Array, position: RowPosition) -> Array:
    """Return a column's value at a position, interpolated linearly between two rows."""
    row, fraction = position
    here: Array = column[row]
    if fraction == 0.0:
        return here
    there: Array = column[row + 1]
    return (1.0 - fraction) * here + fraction * there


def interpolate_orientation(
    quaternions: Array, position: RowPosition
) -> pin.Quaternion:
    """Return the orientation at a position, by slerp between two rows.

    Shapes: quaternions (N, 4).
    """
    row, fraction = position
    start, end = (
        pin.Quaternion(*quaternions[k, [3, 0, 1, 2]]).normalized()
        for k in (row, min(row + 1, len(quaternions) - 1))
    )
    return start.slerp(fraction, end)


def interpolate_configuration(robot: Robot, q: Array, position: RowPosition) -> Array:
    """Return the configuration at a position, on the geodesic between two rows.

    Shapes: q (N, nq).
    """
    row, fraction = position
    here: Array = q[row]
    if fraction == 0.0:
        return here
    return robot.integrate(here, fraction * robot.difference(here, q[row + 1]))
