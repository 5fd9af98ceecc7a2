"""The geometry in a log: skeleton, paths of the tasks, and their extent."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import TaskPath, task_names, task_path
from hsp_control.visualization.plots.obstacles import logged_obstacles


def parents(rollout: Rollout) -> list[int]:
    """Return the index of every skeleton point's parent, -1 for none."""
    return [int(parent) for parent in rollout.meta["robot"]["skeleton_parents"]]


def task_paths(rollout: Rollout) -> list[TaskPath]:
    """Return the paths of all tasks that control a point."""
    paths = (task_path(rollout, name) for name in task_names(rollout))
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
