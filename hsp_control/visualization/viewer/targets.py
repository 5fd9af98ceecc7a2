"""Targets of the tasks in a log, their markers, and desired and actual paths."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import drawn_parts, task_names, task_path
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import (
    ACTUAL,
    AXES,
    DESIRED,
    DESIRED_WIDENING,
    GHOST_NARROWING,
    PATH_RADIUS,
    LegendEntry,
)
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import (
    Command,
    Json,
    extend_trail,
    path_element,
    set_object,
    set_trail,
)
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.threejs import (
    color_number,
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


_MAX_RINGS = 1500


class Paths:
    """The desired path as a sleeve; in it the actual path, up to the current time."""

    def __init__(
        self, motion: Motion, root: str, color: str = ACTUAL, *, ghost: bool = False
    ) -> None:
        """Read the desired and actual positions of the tasks' points."""
        self._root = root
        self._color = color
        self._ghost = ghost
        self._radius = PATH_RADIUS * motion.size
        rows = _ring_rows(len(motion.times))
        self._ring_times = motion.times[rows]
        self._paths = {
            target.name: (target.desired[rows], target.actual[rows])
            for target in read_targets(motion.rows)
            if target.desired is not None
        }

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        radius = PATH_RADIUS * size
        thickness = GHOST_NARROWING if self._ghost else 1.0
        actual, desired = color_number(self._color), color_number(DESIRED)
        for name in self._drawn_desired():
            wide, path = DESIRED_WIDENING * radius, self._path(name, "desired")
            yield set_trail(path, self._paths[name][0], wide, desired, sleeve=True)
        for name in self._drawn_actual():
            path, points = self._path(name, "actual"), self._paths[name][1]
            yield set_trail(path, points, thickness * radius, actual)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        del motion  # the rings have their own times
        rings = np.arange(len(self._ring_times), dtype=float)[:, None]
        for name in self._paths:
            path = self._path(name, "actual")
            yield Track(path, "length", self._ring_times, rings)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        drawn = {
            ("desired path", "desired", DESIRED): self._drawn_desired(),
            ("actual path", "actual", self._color): self._drawn_actual(),
        }
        return [
            LegendEntry(name, color, tuple(self._path(path, kind) for path in paths))
            for (name, kind, color), paths in drawn.items()
            if paths
        ]

    def points(self) -> Array:
        """Return points of the desired paths [m], shape (K, 3)."""
        desired = [points for points, _ in self._paths.values()]
        return np.concatenate([np.zeros((0, 3)), *desired])

    def _drawn_desired(self) -> list[str]:
        """Return the tasks whose desired path is drawn."""
        # A desired position that does not move is shown by its target marker.
        return [
            name
            for name, (desired, _) in self._paths.items()
            if not self._ghost and self._moves(desired)
        ]

    def _drawn_actual(self) -> list[str]:
        """Return the tasks whose actual path is drawn."""
        return [name for name, (_, path) in self._paths.items() if self._moves(path)]

    def _moves(self, path: Array) -> bool:
        """Return whether a path is longer than it is thick."""
        return bool(len(path) and np.ptp(path, axis=0).max() >= self._radius)

    def _path(self, name: str, kind: str) -> str:
        return f"{self._root}/{path_element(name)}/{kind}"


class GrowingPaths(Paths):
    """Paths of a run that is being computed: the actual path grows."""

    def __init__(self, motion: Motion, root: str) -> None:
        """Read the desired positions from a preview."""
        super().__init__(motion, root)
        self._rings = dict.fromkeys(self._paths, 0)
        self._pieces = 0

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        radius = PATH_RADIUS * size
        for name, (desired_points, actual_points) in self._paths.items():
            self._paths[name] = desired_points, actual_points[:0]
            color = color_number(self._color)
            yield set_trail(
                self._path(name, "actual"), actual_points[:0], radius, color
            )
        yield from super().draw(size)

    def extend(self, motion: Motion) -> Iterator[Command]:
        """Yield the commands that extend the actual paths by a part of the run."""
        self._pieces += 1
        for target in read_targets(motion.rows):
            if target.name in self._rings:
                path = self._path(target.name, "actual")
                yield extend_trail(path, target.actual, self._pieces)

    def _drawn_actual(self) -> list[str]:
        """Return all tasks: each path may yet grow."""
        return list(self._paths)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along a part of the run."""
        count = len(motion.times)
        for name, before in self._rings.items():
            rings = np.arange(before, before + count, dtype=float)[:, None]
            yield Track(self._path(name, "actual"), "length", motion.times, rings)
            self._rings[name] = before + count


def _ring_rows(count: int) -> Array:
    return np.linspace(0, count - 1, min(count, _MAX_RINGS)).round().astype(int)
