"""The geometry in a log: skeleton, paths of the tasks, and their extent."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import task_names, task_type
from hsp_control.visualization.plots.obstacles import logged_obstacles


class TaskPath(NamedTuple):
    """The path of a point that a task controls.

    Attributes:
        name: The task's name.
        desired: The desired position [m], shape (N, 3); the actual one along world axes
            that the task does not track.
        actual: The actual position [m], shape (N, 3).
        axes: The world axes that the task tracks, such as ``"xy"``.
    """

    name: str
    desired: Array
    actual: Array
    axes: str


def parents(rollout: Rollout) -> list[int]:
    """Return the index of every skeleton point's parent, -1 for none."""
    return [int(parent) for parent in rollout.meta["robot"]["skeleton_parents"]]


def task_paths(rollout: Rollout) -> list[TaskPath]:
    """Return the paths of all tasks that control a point."""
    paths = (_task_path(rollout, name) for name in task_names(rollout))
    return [path for path in paths if path is not None]


def end_points(rollout: Rollout) -> Array:
    """Return the paths of the skeleton's ends [m], shape (N, ends, 3)."""
    inner = set(parents(rollout))
    ends = [k for k in range(rollout["skeleton"].shape[1]) if k not in inner]
    return rollout["skeleton"][:, ends]


def enclosing_points(rollout: Rollout) -> Array:
    """Return points that enclose robot, paths and obstacles [m], shape (K, 3)."""
    around = [
        obstacle.enclosing_points()
        for obstacle in logged_obstacles(rollout)
        if not obstacle.oversized
    ]
    return np.concatenate([*_robot_and_paths(rollout), *around])


def center_points(rollout: Rollout) -> Array:
    """Return points of robot and paths, and the obstacles' centres [m], shape (K, 3).

    They lie in a plane if all motion does; the obstacles' size does not matter.
    """
    middles = [
        obstacle.center
        for obstacle in logged_obstacles(rollout)
        if not obstacle.oversized
    ]
    return np.concatenate([*_robot_and_paths(rollout), *middles])


def _robot_and_paths(rollout: Rollout) -> list[Array]:
    paths = task_paths(rollout)
    return [rollout["skeleton"].reshape(-1, 3), *(path.desired for path in paths)]


def _task_path(rollout: Rollout, name: str) -> TaskPath | None:
    reference = rollout[f"task.{name}.reference"]
    actual = rollout[f"task.{name}.actual"]
    if task_type(rollout, name) == "FramePose":
        return TaskPath(name, reference[:, :3], actual[:, :3], "xyz")
    if task_type(rollout, name) != "FramePosition":
        return None
    axes, path = _located(rollout, name, actual)
    desired = path.copy()
    desired[:, ["xyz".index(axis) for axis in axes]] = reference
    return TaskPath(name, desired, path, axes)


def _located(rollout: Rollout, name: str, actual: Array) -> tuple[str, Array]:
    """Return the axes that a task tracks, and the path of its point.

    The point is found in the skeleton, which also has the axes that are not tracked.
    """
    axes = str(rollout.meta["tasks"][name]["axes"])
    skeleton, columns = rollout["skeleton"], ["xyz".index(axis) for axis in axes]
    for point in reversed(range(skeleton.shape[1])):
        if np.array_equal(skeleton[:, point, columns], actual):
            return axes, skeleton[:, point]
    path = np.zeros((len(actual), 3))
    path[:, columns] = actual
    return axes, path
