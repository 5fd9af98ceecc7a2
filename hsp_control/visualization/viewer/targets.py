"""Targets of the tasks in a log, and their markers: a ball, an arrow, three axes."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import drawn_parts, task_names, task_path
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import AXES, DESIRED, PATH_RADIUS
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, Json, set_object
from hsp_control.visualization.viewer.legend import LegendEntry
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.scene_path import path_element
from hsp_control.visualization.viewer.threejs import (
    material,
    pose_along,
    quaternions_along,
)


class Target(NamedTuple):
    """The target of one task at every row, and the actual position."""

    name: str
    actual: Array  # the actual position of the task's point [m], (N, 3)
    # Its desired position [m], (N, 3); the actual one along world axes that the task
    # does not track. None if the task tracks no position.
    desired: Array | None = None
    # The desired orientation as a quaternion (x, y, z, w), (N, 4).
    rotation: Array | None = None
    direction: Array | None = None  # the desired direction, unit vectors, (N, 3)


def read_targets(rollout: Rollout) -> list[Target]:
    """Return the targets of all tasks that can be shown in space."""
    if "skeleton" not in rollout:
        return []
    targets = (_target(rollout, name) for name in task_names(rollout))
    return [target for target in targets if target is not None]


def _target(rollout: Rollout, name: str) -> Target | None:
    parts = drawn_parts(rollout, name)
    if not parts:
        return None
    path = task_path(rollout, name)
    reference = rollout[f"task.{name}.reference"]
    orientation, direction = parts.get("orientation"), parts.get("direction")
    return Target(
        name,
        # Without a position: the last frame that a task tracks.
        rollout["skeleton"][:, -1] if path is None else path.actual,
        None if path is None else path.desired,
        None if orientation is None else reference[:, orientation],
        None if direction is None else reference[:, direction],
    )


class TargetMarkers:
    """The targets of all tasks that can be shown in space."""

    def __init__(self, motion: Motion, root: str) -> None:
        """Find the tasks that have a target in space."""
        self._root = root
        self._targets = read_targets(motion.rows)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for target in self._targets:
            yield set_object(self._path(target), _mark(target, PATH_RADIUS * size))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        times = motion.times
        for target in read_targets(motion.rows):
            path = self._path(target)
            position = target.actual if target.desired is None else target.desired
            yield Track(path, "position", times, position)
            if target.rotation is not None:
                yield Track(path, "quaternion", times, target.rotation)
            elif target.direction is not None:
                turned = quaternions_along(target.direction)
                yield Track(path, "quaternion", times, turned)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        name = "target" if len(self._targets) == 1 else "targets"
        paths = tuple(map(self._path, self._targets))
        return [LegendEntry(name, DESIRED, paths)] if paths else []

    def _path(self, target: Target) -> str:
        return f"{self._root}/{path_element(target.name)}"


def _mark(target: Target, radius: float) -> Json:
    if target.direction is not None:
        surface = material(DESIRED)
        return threejs.group(
            [threejs.mesh(threejs.arrow(60 * radius, 2 * radius), surface)]
        )
    if target.rotation is None:
        surface = material(DESIRED)
        return threejs.group([threejs.mesh(threejs.sphere(4.5 * radius), surface)])
    arrows = []
    for axis, color in zip(np.eye(3), AXES, strict=True):
        body = threejs.arrow(40.0 * radius, 1.5 * radius)
        arrows.append(threejs.mesh(body, material(color), pose_along(axis)))
    return threejs.group(arrows)
