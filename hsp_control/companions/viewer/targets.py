"""Targets of the tasks in a log, their markers, and desired and actual paths."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.companions.plots.log_series import (
    drawn_parts,
    finite_points,
    task_path,
)
from hsp_control.companions.plots.palette import ACTUAL, DESIRED, OBSTACLE, TASK
from hsp_control.companions.viewer import threejs
from hsp_control.companions.viewer.commands import (
    Json,
    LegendEntry,
    PageCommand,
    path_element,
    set_object,
    set_trail,
)
from hsp_control.companions.viewer.motion import Layer, RunMotion, Track
from hsp_control.simulation import Rollout
from hsp_control.simulation.measures import task_names

AXES = (OBSTACLE, TASK, ACTUAL)
"""x, y and z axis of a target: like red, green, blue, but safe for colour blindness."""
PATH_RADIUS = 0.0045  # radius of the actual path, over the size of the scene
_DESIRED_WIDENING = 2.0
"""Radius of the desired path over that of the actual path, which it encloses."""
_GHOST_NARROWING = 0.8
"""Radius of a ghost's path over that of the run, which encloses it."""
_MAX_RINGS = 1500


class TaskTarget(NamedTuple):
    """The target of one task at every row, and the actual position."""

    name: str
    actual: Array  # the actual position of the task's point [m], (N, 3)
    # Its desired position [m], (N, 3); the actual one along world axes that the task
    # does not track. None if the task tracks no position.
    desired: Array | None = None
    # The desired orientation as a quaternion (x, y, z, w), (N, 4).
    rotation: Array | None = None
    direction: Array | None = None  # the desired direction, unit vectors, (N, 3)


def read_targets(rollout: Rollout) -> list[TaskTarget]:
    """Return the targets of all tasks that can be shown in space."""
    if "skeleton" not in rollout:
        return []
    targets = []
    for name in task_names(rollout):
        parts = drawn_parts(rollout, name)
        if not parts:
            continue
        path, reference = task_path(rollout, name), rollout[f"task.{name}.reference"]
        turned, pointed = parts.get("orientation"), parts.get("direction")
        targets.append(
            TaskTarget(
                name,
                # Without a position: the last frame that a task tracks.
                rollout["skeleton"][:, -1] if path is None else path.actual,
                None if path is None else _held(path.desired),
                None if turned is None else _held(reference[:, turned]),
                None if pointed is None else _held(reference[:, pointed]),
            )
        )
    return targets


def _held(values: Array) -> Array | None:
    """Return values of which each row without numbers repeats the one before it.

    A page moves only to numbers. None if there are none.
    """
    finite = np.isfinite(values).all(axis=1)
    if finite.all():
        return values
    if not finite.any():
        return None
    last = np.maximum.accumulate(np.where(finite, np.arange(len(values)), -1))
    return values[np.where(last < 0, np.argmax(finite), last)]


def target_markers(motion: RunMotion, root: str) -> Layer:
    """Draw the present references of tasks: a ball, an arrow, or three axes."""
    targets = read_targets(motion.rows)
    paths = {each.name: f"{root}/{path_element(each.name)}" for each in targets}

    def draw(size: float) -> Iterator[PageCommand]:
        for target in targets:
            yield set_object(paths[target.name], _mark(target, PATH_RADIUS * size))

    def tracks(motion: RunMotion) -> Iterator[Track]:
        for target in read_targets(motion.rows):
            path, times = paths[target.name], motion.times
            place = target.actual if target.desired is None else target.desired
            yield Track(path, "position", times, place)
            if target.rotation is not None:
                yield Track(path, "quaternion", times, target.rotation)
            elif target.direction is not None:
                turned = threejs.quaternions_along(target.direction)
                yield Track(path, "quaternion", times, turned)

    def legend() -> list[LegendEntry]:
        name = "target" if len(targets) == 1 else "targets"
        return [LegendEntry(name, DESIRED, tuple(paths.values()))] if targets else []

    return Layer(draw, tracks, legend)


def _mark(target: TaskTarget, radius: float) -> Json:
    if target.rotation is None and target.direction is None:
        return threejs.mesh_group(
            threejs.sphere(4.5 * radius), threejs.material(DESIRED)
        )
    if target.rotation is None:
        return threejs.mesh_group(
            threejs.arrow(60 * radius, 2 * radius), threejs.material(DESIRED)
        )
    arrow = threejs.arrow(40.0 * radius, 1.5 * radius)
    return threejs.group(
        [
            threejs.mesh(arrow, threejs.material(color), threejs.pose_along(axis))
            for axis, color in zip(np.eye(3), AXES, strict=True)
        ]
    )


def desired_points(motion: RunMotion) -> Array:
    """Return points of the desired paths [m], shape (K, 3)."""
    found = [t.desired for t in read_targets(motion.rows) if t.desired is not None]
    return finite_points(np.concatenate([np.zeros((0, 3)), *found]))


def paths(
    motion: RunMotion, root: str, color: str = ACTUAL, *, ghost: bool = False
) -> Layer:
    """Draw the desired path as a sleeve; in it the actual path, up to the present.

    A ghost has no sleeve, and a thinner path.
    """
    last = len(motion.times) - 1
    rings = np.linspace(0, last, min(last + 1, _MAX_RINGS)).round().astype(int)
    targets = [t for t in read_targets(motion.rows) if t.desired is not None]
    sleeves = {} if ghost else _moving(motion, "desired", rings)
    actual = _moving(motion, "actual", rings)

    def draw(size: float) -> Iterator[PageCommand]:
        radius = PATH_RADIUS * size
        yield from _draw_sleeves(sleeves, root, radius)
        thickness = _GHOST_NARROWING * radius if ghost else radius
        for name, points in actual.items():
            path = _node(root, name, "actual")
            yield set_trail(path, points, thickness, threejs.color_number(color))

    def tracks(_: RunMotion) -> Iterator[Track]:
        for target in targets:  # the rings have their own times
            numbers = np.arange(len(rings), dtype=float)[:, None]
            path = _node(root, target.name, "actual")
            yield Track(path, "length", motion.times[rings], numbers)

    return Layer(draw, tracks, lambda: _path_legend(root, sleeves, actual, color))


def growing_paths(
    preview: RunMotion, root: str
) -> tuple[Layer, Callable[[RunMotion], Iterator[PageCommand]]]:
    """Draw paths of a run that is being computed; return also their extension.

    The desired paths are those of a preview. An extension begins at the last point.
    """
    rings = np.arange(len(preview.times))
    sleeves = _moving(preview, "desired", rings)
    targets = [t for t in read_targets(preview.rows) if t.desired is not None]
    points = {target.name: np.zeros((0, 3)) for target in targets}
    radius = 0.0

    def trails() -> Iterator[PageCommand]:
        for name, path in points.items():
            node = _node(root, name, "actual")
            yield set_trail(node, path, radius, threejs.color_number(ACTUAL))

    def draw(size: float) -> Iterator[PageCommand]:
        nonlocal radius
        radius = PATH_RADIUS * size
        yield from _draw_sleeves(sleeves, root, radius)
        yield from trails()

    def tracks(motion: RunMotion) -> Iterator[Track]:
        for name, before in points.items():
            first = max(len(before) - 1, 0)
            numbers = first + np.arange(len(motion.times), dtype=float)[:, None]
            yield Track(_node(root, name, "actual"), "length", motion.times, numbers)

    def extend(motion: RunMotion) -> Iterator[PageCommand]:
        for target in read_targets(motion.rows):
            if target.name in points:
                known = points[target.name][:-1]
                points[target.name] = np.vstack([known, target.actual])
        yield from trails()

    layer = Layer(draw, tracks, lambda: _path_legend(root, sleeves, points, ACTUAL))
    return layer, extend


def _moving(motion: RunMotion, kind: str, rows: Indices) -> dict[str, Array]:
    """Return paths that are longer than thick; others are shown by their markers."""
    found = {
        target.name: np.asarray(getattr(target, kind))[rows]
        for target in read_targets(motion.rows)
        if target.desired is not None
    }
    thick = PATH_RADIUS * motion.size
    return {
        name: path
        for name, path in found.items()
        if len(path) and np.ptp(path, axis=0).max() >= thick
    }


def _draw_sleeves(
    sleeves: Mapping[str, Array], root: str, radius: float
) -> Iterator[PageCommand]:
    for name, points in sleeves.items():
        path, wide = _node(root, name, "desired"), _DESIRED_WIDENING * radius
        yield set_trail(path, points, wide, threejs.color_number(DESIRED), sleeve=True)


def _path_legend(
    root: str, desired: Iterable[str], actual: Iterable[str], color: str
) -> list[LegendEntry]:
    rows = {"desired": (desired, DESIRED), "actual": (actual, color)}
    return [
        LegendEntry(f"{kind} path", shade, tuple(_node(root, n, kind) for n in names))
        for kind, (names, shade) in rows.items()
        if names
    ]


def _node(root: str, name: str, kind: str) -> str:
    return f"{root}/{path_element(name)}/{kind}"
