"""Targets of the tasks in a log: positions, orientations, directions."""

from itertools import permutations
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout


class Target(NamedTuple):
    """The target of one task at every row, and the actual position.

    Attributes:
        name: The task's name.
        actual: The actual position of the task's point [m], shape (N, 3).
        desired: Its desired position [m], shape (N, 3); the actual one along world axes
            that the task does not track. None if the task tracks no position.
        rotation: The desired orientation as a quaternion (x, y, z, w), shape (N, 4).
        direction: The desired direction, unit vectors, shape (N, 3).
    """

    name: str
    actual: Array
    desired: Array | None = None
    rotation: Array | None = None
    direction: Array | None = None


def read_targets(rollout: Rollout) -> list[Target]:
    """Return the targets of all tasks that can be shown in space."""
    if "skeleton" not in rollout:
        return []
    targets = (_target(rollout, name) for name in rollout.meta.get("tasks", {}))
    return [target for target in targets if target is not None]


def _target(rollout: Rollout, name: str) -> Target | None:
    reference = rollout[f"task.{name}.reference"]
    actual = rollout[f"task.{name}.actual"]
    tip = rollout["skeleton"][:, -1]  # the last frame that a task tracks
    match rollout.meta["tasks"][name].get("type"):
        case "FramePosition":
            point, axes = _located(rollout, actual)
            desired = point.copy()
            desired[:, axes] = reference
            return Target(name, point, desired)
        case "FramePose":
            pose = reference[:, :3], reference[:, 3:]
            return Target(name, actual[:, :3], *pose)
        case "FrameOrientation":
            return Target(name, tip, rotation=reference)
        case "Pointing":
            return Target(name, tip, direction=reference)
    return None


def _located(rollout: Rollout, actual: Array) -> tuple[Array, list[int]]:
    """Return the skeleton's point that a task tracks, and the tracked axes.

    The log contains neither; they are found by equality with the logged positions.
    """
    skeleton = rollout["skeleton"]
    rows = actual.shape[1]
    for axes in permutations(range(3), rows):
        columns = list(axes)
        for point in reversed(range(skeleton.shape[1])):
            if np.array_equal(skeleton[:, point, columns], actual):
                return skeleton[:, point], columns
    path = np.zeros((len(actual), 3))
    path[:, :rows] = actual
    return path, list(range(rows))
