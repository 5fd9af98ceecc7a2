"""Desired and actual path of the end effector."""

import numpy as np
from matplotlib.axes import Axes

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.visualization import palette
from hsp_control.visualization.plots.box_axes import corners, draw_box
from hsp_control.visualization.plots.legends import legend_below, literal_text, note
from hsp_control.visualization.plots.logged_geometry import (
    center_points,
    enclosing_points,
    end_points,
    task_paths,
)
from hsp_control.visualization.plots.obstacles import logged_obstacles
from hsp_control.visualization.plots.views import (
    View,
    best_plane,
    fit,
    is_flat,
    oblique,
    plane,
)
from hsp_control.visualization.plots.world_drawing import draw_obstacle

NEARLY_FLAT = 0.05
"""Depth over width below which a path is drawn in one plane."""


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
    paths = task_paths(rollout)
    if not paths:
        return end_points(rollout).reshape(-1, 3)
    return np.concatenate([points for path in paths for points in path[1:3]])
