"""The rows of a log that are drawn: close enough in time to look smooth."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot, RobotState
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import drawn_parts, task_names


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
    """Return the orientation at a position, by slerp between two rows."""
    row, fraction = position
    start, end = (
        pin.Quaternion(*quaternions[k, [3, 0, 1, 2]]).normalized()
        for k in (row, min(row + 1, len(quaternions) - 1))
    )
    return start.slerp(fraction, end)


def interpolate_configuration(robot: Robot, q: Array, position: RowPosition) -> Array:
    """Return the configuration at a position, on the geodesic between two rows."""
    row, fraction = position
    here: Array = q[row]
    if fraction == 0.0:
        return here
    return robot.integrate(here, fraction * robot.difference(here, q[row + 1]))


FINEST = 0.01  # minimum time between two drawn rows [s]
COARSEST = 1 / 30
"""Maximum time between two drawn rows [s]; the page interpolates linearly."""


class Motion(NamedTuple):
    """A robot's motion in a run."""

    robot: Robot
    rows: Rollout  # the rows to draw, as a log

    @property
    def times(self) -> Array:
        """The rows' times [s], shape (N,)."""
        return self.rows.t

    @property
    def size(self) -> float:
        """Diagonal of the box around all joint positions of the run [m]."""
        if "skeleton" in self.rows:
            points = self.rows["skeleton"].reshape(-1, 3)
        else:
            first = next(self.states())
            points = np.array([place.translation for place in first.data.oMi])
        return float(np.linalg.norm(np.ptp(points, axis=0))) or 1.0

    def states(self) -> Iterator[RobotState]:
        """Yield the state at each row; the next row overwrites it."""
        state = RobotState(self.robot)
        for t, q, v in zip(self.rows.t, self.rows.q, self.rows.v, strict=True):
            yield state.update(float(t), q, v)


def motion_of(
    robot: Robot, rollout: Rollout, finest: float = FINEST, coarsest: float = COARSEST
) -> Motion:
    """Return the rows of a log that are drawn: thinned, or with interpolated rows."""
    times = drawn_times(rollout.t, finest, coarsest)
    if len(times) == len(rollout.t) and np.array_equal(times, rollout.t):
        return Motion(robot, rollout)
    kept = np.searchsorted(rollout.t, times)
    on_rows = kept < len(rollout.t)
    on_rows[on_rows] = rollout.t[kept[on_rows]] == times[on_rows]
    if on_rows.all():
        columns = {name: column[kept] for name, column in rollout.columns.items()}
        return Motion(robot, Rollout(columns, rollout.meta))
    positions = [row_position(rollout.t, time) for time in times]
    columns = {}
    for name, column in rollout.columns.items():
        if name == "q":
            rows = [
                interpolate_configuration(robot, column, position)
                for position in positions
            ]
        else:
            rows = [interpolate_column(column, position) for position in positions]
        columns[name] = np.array(rows)
    for name, where in _orientations(rollout):
        turns = rollout[name][:, where]
        columns[name][:, where] = [
            interpolate_orientation(turns, position).coeffs() for position in positions
        ]
    return Motion(robot, Rollout(columns, rollout.meta))


def _orientations(rollout: Rollout) -> Iterator[tuple[str, slice]]:
    """Yield the columns, and the parts of them, that are quaternions."""
    for name in rollout.columns:
        if name.endswith(".quaternion"):
            yield name, slice(0, 4)
    for task in task_names(rollout):
        where = drawn_parts(rollout, task).get("orientation")
        if where is not None:
            yield f"task.{task}.reference", where
            yield f"task.{task}.actual", where


def drawn_times(times: Array, finest: float, coarsest: float) -> Array:
    """Return the times to draw: a choice of the given ones, and times between them.

    The first and the last time are always included.
    """
    kept = [0]
    for row in range(1, len(times)):
        if times[row] - times[kept[-1]] >= finest * (1.0 - 1e-6):
            kept.append(row)
    last = len(times) - 1
    if kept[-1] != last:
        # The end is always drawn; it replaces a row that is too close before it.
        kept[-1 if len(kept) > 1 else len(kept) :] = [last]
    chosen = times[kept]
    gaps = np.diff(chosen)
    parts = np.ceil(gaps / coarsest * (1.0 - 1e-6)).astype(int).clip(1)
    if (parts == 1).all():
        return np.asarray(chosen)
    filled = [
        np.linspace(start, end, count, endpoint=False)
        for start, end, count in zip(chosen[:-1], chosen[1:], parts, strict=True)
    ]
    return np.concatenate([*filled, chosen[-1:]])
