"""Desired and actual path of the end effector, in a plane or in a box."""

from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from hsp_control.common.arrays import Array
from hsp_control.companions.plots import palette
from hsp_control.companions.plots.curves import legend_below, literal_text, note
from hsp_control.companions.plots.log_series import finite_points
from hsp_control.companions.plots.world import (
    View,
    best_plane,
    center_points,
    corners,
    draw_obstacle,
    enclosing_points,
    end_points,
    fit,
    is_flat,
    logged_obstacles,
    oblique,
    plane,
    task_paths,
)
from hsp_control.simulation import Rollout


class _LabelledEdge(NamedTuple):
    """The edge with the tick labels of an axis; the eye is at high x, low y, high z."""

    sides: tuple[int, int]  # the edge, as sides of the two other axes: 0 low, 1 high
    shift: tuple[float, float]  # offset of the labels from the edge [pt]
    align: str  # horizontal alignment of the labels


_EDGES = (
    _LabelledEdge((0, 0), (-3.0, -4.0), "right"),
    _LabelledEdge((1, 0), (4.0, -4.0), "left"),
    _LabelledEdge((0, 0), (-5.0, 0.0), "right"),
)
_DIGIT_WIDTH = 4.8  # width of a digit [pt]
_NARROWEST = 115.0
"""Width or height, the larger one, of the smallest box in a figure [pt]."""
_HEIGHT = 11.0  # height of a line of tick labels [pt]
_CLEAR = 1.2  # distance of labels, in sums of their widths and heights
_WALLS = ((0, 0), (1, 1), (2, 0))
"""The sides behind the scene, (axis, side): low x, high y and the floor."""


def draw_box(axes: Axes, view: View, lower: Array, upper: Array) -> None:
    """Draw the back walls of a box with a grid, and tick labels along three edges."""
    axes.set_axis_off()
    ends = np.stack([lower, upper])
    ticks = [_apart(view, ends, _ticks(view, ends, axis), axis) for axis in range(3)]
    for normal, side in _WALLS:
        _draw_wall(axes, view, ends, ticks, normal, side)
    for axis in range(3):
        _draw_tick_labels(axes, view, ends, ticks[axis], axis)


def _ticks(view: View, ends: Array, axis: int) -> Array:
    """Return round tick values along an edge; fewer for a shorter edge."""
    lengths = np.ptp(ends, axis=0) * np.linalg.norm(view.rows, axis=0)
    count = max(2, round(4.0 * float(lengths[axis] / lengths.max())))
    low, high = ends[:, axis]
    near = 0.07 * (high - low)  # where labels of x and y would overlap
    first, last = low + near * (axis == 1), high - near * (axis == 0)
    inside = np.zeros(0)
    while len(inside) < 2 and count < 10:  # a single tick gives no scale
        ticks = np.asarray(
            MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(low, high)
        )
        inside = ticks[(ticks >= first) & (ticks <= last)]
        count += 1
    return np.asarray(np.round(inside, 9))


def _apart(view: View, ends: Array, ticks: Array, axis: int) -> Array:
    """Return the ticks, or every second, third, ... if their labels would overlap."""
    page = np.column_stack(view.project(corners(*ends)))
    scale = _NARROWEST / float(np.ptp(page, axis=0).max())
    direction = scale * np.abs(view.rows[:, axis])  # [pt] on the page for each metre
    wide = _DIGIT_WIDTH * max((len(f"{tick:g}") for tick in ticks), default=1)
    for stride in range(1, len(ticks)):
        kept = ticks[::stride]
        across, up = direction * (kept[1] - kept[0])
        if across / wide + up / _HEIGHT >= _CLEAR:
            return np.asarray(kept)
    return np.asarray(ticks[:1])


def _draw_wall(
    axes: Axes, view: View, ends: Array, ticks: list[Array], normal: int, side: int
) -> None:
    across = [axis for axis in range(3) if axis != normal]
    corners = np.tile(ends[side], (4, 1))
    for corner, sides in zip(corners, ((0, 0), (0, 1), (1, 1), (1, 0)), strict=True):
        corner[across] = [ends[s, axis] for s, axis in zip(sides, across, strict=True)]
    page = np.column_stack(view.project(corners))
    wall = Polygon(page, facecolor=palette.WALL, edgecolor=palette.GRID, zorder=0.5)
    axes.add_patch(wall)
    for along, other in (across, across[::-1]):
        for tick in ticks[along]:
            line = np.tile(ends[side], (2, 1))
            line[:, along], line[:, other] = tick, ends[:, other]
            page_line = view.project(line)
            axes.plot(*page_line, color=palette.GRID, linewidth=0.6, zorder=0.6)


def _draw_tick_labels(
    axes: Axes, view: View, ends: Array, ticks: Array, axis: int
) -> None:
    sides, shift, align = _EDGES[axis]
    others = [other for other in range(3) if other != axis]
    edge = ends.copy()
    for other, side in zip(others, sides, strict=True):
        edge[:, other] = ends[side, other]
    axes.plot(*view.project(edge), color=palette.MUTED, linewidth=0.7, zorder=0.7)
    numbers = [f"{tick:g}".replace("-", "−") for tick in ticks]
    upright = axis == 2
    for tick, number in zip(ticks, numbers, strict=True):
        point = edge[0].copy()
        point[axis] = tick
        x, y = view.project(point)
        axes.annotate(
            number,
            (float(x), float(y)),
            xytext=shift,
            textcoords="offset points",
            ha=align,
            va="center" if upright else "top",
            fontsize=8.0,
        )
    widest = _DIGIT_WIDTH * max(map(len, numbers), default=0)
    x, y = view.project(edge.mean(axis=0))
    axes.annotate(
        f"{'xyz'[axis]} [m]",
        (float(x), float(y)),
        xytext=((-16.0, -18.0), (8.0 + 0.5 * widest, -16.0), (-9.0 - widest, 0.0))[
            axis
        ],
        textcoords="offset points",
        ha=("right", "left", "right")[axis],
        va="center" if upright else "top",
        rotation=90.0 if upright else 0.0,
    )


NEARLY_FLAT = 0.05  # depth over width below which a path is drawn in one plane


def path_view(rollout: Rollout) -> View:
    """Return the plane of robot, tasks or flat paths; else an oblique view."""
    if is_flat(whole := center_points(rollout)):
        return plane(best_plane(whole))
    tracked = {"".join(sorted(path.axes)) for path in task_paths(rollout)}
    if len(tracked) == 1 and len(only := tracked.pop()) == 2:
        return plane(only)
    middles = [
        obstacle.center
        for obstacle in logged_obstacles(rollout)
        if not obstacle.oversized
    ]
    seen = np.concatenate([_path_points(rollout), *middles])
    return plane(best_plane(seen)) if is_flat(seen, NEARLY_FLAT) else oblique()


def draw_end_effector(axes: Axes, rollout: Rollout, *, names: str = "") -> None:
    """Draw desired and actual paths, and obstacles (dashed: at the start)."""
    view = plane(names) if names else path_view(rollout)
    paths = task_paths(rollout)
    for place, path in enumerate(paths):
        page = view.project(path.desired)
        still = max(float(np.ptp(coordinate)) for coordinate in page) < 1e-9
        axes.plot(
            *page,
            color=palette.DESIRED,
            linewidth=3.6,
            marker="o" if still else "",
            markersize=9.0,
            zorder=2.2,
            label=_desired_label(path.axes, view) if place == 0 else None,
        )
    for place, path in enumerate(paths):
        name = path.name if len(paths) > 1 else ""
        _draw_track(
            axes, view, path.actual, place, literal_text(f"{name} actual".strip())
        )
    if not paths:
        ends = end_points(rollout)
        for k in range(ends.shape[1]):
            label = "end of the robot" if k == 0 else None
            _draw_track(axes, view, ends[:, k], k, label)
        note(axes, "no task controls a point")
    _draw_obstacles(axes, view, rollout)
    min_width = 0.02 * float(np.ptp(enclosing_points(rollout), axis=0).max())
    around = [
        obstacle.enclosing_points()
        for obstacle in logged_obstacles(rollout)
        if not obstacle.oversized
    ]
    seen = np.concatenate([_path_points(rollout), *around])
    if view.names:
        fit(axes, view, seen, min_width)
    else:
        middle = 0.5 * (seen.min(axis=0) + seen.max(axis=0))
        half = np.maximum(0.53 * np.ptp(seen, axis=0), 0.5 * min_width)
        draw_box(axes, view, middle - half, middle + half)
        fit(axes, view, corners(middle - half, middle + half), margin=0.01)
    legend_below(axes)


def _draw_track(
    axes: Axes, view: View, points: Array, place: int, label: str | None
) -> None:
    color = palette.task(place)
    axes.plot(*view.project(points), color=color, zorder=2.4, label=label)
    for row, face, name in ((0, palette.PAPER, "start"), (-1, color, "end")):
        axes.plot(
            *view.project(points[[row]]),
            linestyle="none",
            marker="o",
            markersize=5.0,
            markerfacecolor=face,
            markeredgecolor=color,
            zorder=2.6,
            label=name if place == 0 else None,
        )


def _draw_obstacles(axes: Axes, view: View, rollout: Rollout) -> None:
    found = logged_obstacles(rollout)
    label = "obstacle" if len(found) == 1 else "obstacles"
    for place, obstacle in enumerate(found):
        draw_obstacle(axes, view, obstacle, -1, label=label if place == 0 else None)
        if obstacle.moves:
            draw_obstacle(axes, view, obstacle, 0, filled=False)
            page = view.project(obstacle.center)
            axes.plot(*page, color=palette.OBSTACLE, linewidth=1.1, linestyle=":")


def _desired_label(axes: str, view: View) -> str:
    """Return the label, with the tracked axes if the view has others, too."""
    return f"desired ({axes})" if set(view.names or "xyz") - set(axes) else "desired"


def _path_points(rollout: Rollout) -> Array:
    """Return the points of all paths, or of the robot's ends [m], shape (K, 3)."""
    paths = [points for path in task_paths(rollout) for points in path[1:3]]
    points = finite_points(np.concatenate([np.zeros((0, 3)), *paths]))
    return points if len(points) else end_points(rollout).reshape(-1, 3)
