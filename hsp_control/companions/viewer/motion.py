"""Motion of the scene: the rows of a log that are drawn, tracks, and layers."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.companions.plots.log_series import drawn_parts
from hsp_control.companions.viewer.commands import LegendEntry, PageCommand
from hsp_control.robot import Robot, RobotState
from hsp_control.simulation import Rollout
from hsp_control.simulation.measures import task_names

FINEST = 0.01  # minimum time between two drawn rows [s]
COARSEST = 1 / 30
"""Maximum time between two drawn rows [s]; the page interpolates linearly."""


class RunMotion(NamedTuple):
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
        """Yield the state at every row; the next row overwrites it."""
        state = RobotState(self.robot)
        for t, q, v in zip(self.rows.t, self.rows.q, self.rows.v, strict=True):
            yield state.update(float(t), q, v)

    def joint_poses(self) -> Array:
        """Return the joints' x, y, z and quaternion, shape (N, njoints, 7)."""
        poses = np.empty((len(self.times), self.robot.model.njoints, 7))
        for row, state in enumerate(self.states()):
            for joint, placement in enumerate(state.data.oMi):
                poses[row, joint] = pin.SE3ToXYZQUAT(placement)
        return poses


class Track(NamedTuple):
    """The animation of one property of one node."""

    path: str
    # ``position`` [m], ``quaternion`` (x, y, z, w), ``scale``, ``color``, ``visible``
    # or ``length``; see ``page/player.js``.
    property: str
    times: Array  # times [s], ascending, (n,)
    values: Array  # one row per time, (n, k)


def pose_tracks(path: str, times: Array, poses: Array) -> Iterator[Track]:
    """Yield the tracks of a node along poses: x, y, z, quaternion, shape (N, 7)."""
    yield Track(path, "position", times, poses[:, :3])
    yield Track(path, "quaternion", times, poses[:, 3:])


@dataclass
class Layer:
    """One idea in the scene: how it is drawn, how it moves, its rows of the legend.

    Attributes:
        draw: Yields the commands that draw it in a scene of a size [m].
        tracks: Yields its tracks along a run, or along a part of one.
        legend: Returns the legend's entries.
    """

    draw: Callable[[float], Iterable[PageCommand]]
    tracks: Callable[[RunMotion], Iterable[Track]]
    legend: Callable[[], list[LegendEntry]]


def motion_of(
    robot: Robot, rollout: Rollout, finest: float = FINEST, coarsest: float = COARSEST
) -> RunMotion:
    """Return the rows of a log that are drawn: thinned, or with interpolated rows."""
    times = drawn_times(rollout.t, finest, coarsest)
    if len(times) == len(rollout.t) and np.array_equal(times, rollout.t):
        return RunMotion(robot, rollout)
    kept = np.searchsorted(rollout.t, times)
    on_rows = kept < len(rollout.t)
    on_rows[on_rows] = rollout.t[kept[on_rows]] == times[on_rows]
    if on_rows.all():
        columns = {name: column[kept] for name, column in rollout.columns.items()}
        return RunMotion(robot, Rollout(columns, rollout.meta))
    places = np.interp(times, rollout.t, np.arange(len(rollout)))
    rows = np.minimum(places.astype(int), len(rollout) - 2)
    shares = places - rows
    columns = {}
    for name, column in rollout.columns.items():
        share = shares.reshape(-1, *[1] * (column.ndim - 1))
        here, there = column[rows], column[rows + 1]
        mixed = (1.0 - share) * here + share * there
        # At a row its exact value, also beside a row with NaN.
        mixed = np.where(share == 0.0, here, mixed)
        columns[name] = np.where(share == 1.0, there, mixed)
    # Configurations on their geodesics, orientations on the sphere.
    q = rollout.q
    for k, (row, share) in enumerate(zip(rows, shares, strict=True)):
        step = share * robot.difference(q[row], q[row + 1])
        columns["q"][k] = robot.integrate(q[row], step)
    for name, where in _orientations(rollout):
        turns = [
            pin.Quaternion(*turn[[3, 0, 1, 2]]).normalized()
            for turn in rollout[name][:, where]
        ]
        columns[name][:, where] = [
            turns[row].slerp(share, turns[row + 1]).coeffs()
            for row, share in zip(rows, shares, strict=True)
        ]
    return RunMotion(robot, Rollout(columns, rollout.meta))


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
