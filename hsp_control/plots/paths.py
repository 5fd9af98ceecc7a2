"""The path of the end effector in the world, as it was asked for and as it was."""

import numpy as np
from matplotlib.axes import Axes

from hsp_control.plots import palette
from hsp_control.plots.legends import legend_below, note, plain
from hsp_control.plots.lines import single
from hsp_control.plots.things import draw_ball
from hsp_control.plots.views import View, best_plane, fit, is_flat, plane
from hsp_control.plots.world import (
    ball,
    end_points,
    everything,
    obstacles,
    task_paths,
)
from hsp_control.robot import Array
from hsp_control.simulation import Rollout

NEARLY_FLAT = 0.05
"""Depth over width below which one view of a path is enough."""
_ACTUAL = (palette.ACTUAL, *palette.SERIES[2:5], palette.INK)
"""Colours of several tasks' paths; the desired ones are all of the colour DESIRED."""


def path_planes(rollout: Rollout) -> list[str]:
    """Return the planes in which to draw the end effector's path: one, or two.

    The robot's plane if it moves in one; the plane that the tasks track if they track
    two axes; else the plane of the two axes along which paths and obstacles spread most,
    and if they are not flat, the plane of the widest axis and of the third as well.
    """
    whole, seen = everything(rollout, balls=False), _seen(rollout, balls=False)
    if is_flat(whole):
        return [best_plane(whole)]
    tracked = {"".join(sorted(path.axes)) for path in task_paths(rollout)}
    if len(tracked) == 1 and len(only := tracked.pop()) == 2:
        return [only]
    best = best_plane(seen)
    if is_flat(seen, NEARLY_FLAT):
        return [best]
    widest = "xyz"[int(np.argmax(np.ptp(seen, axis=0)))]
    third = next(name for name in "xyz" if name not in best)
    return [best, "".join(sorted(widest + third))]


def draw_end_effector(
    axes: Axes, rollout: Rollout, *, names: str | None = None, legend: bool = True
) -> None:
    """Draw desired and actual path of every point that a task leads, and obstacles.

    Obstacles are drawn where they are at the end, and dashed where they were at the
    start.

    Args:
        axes: The axes.
        rollout: The log.
        names: The world axes to draw, such as ``"xz"``; None: the best of
            `path_planes`.
        legend: Put a legend under the axes.
    """
    view = plane(names or path_planes(rollout)[0])
    paths = task_paths(rollout)
    for place, path in enumerate(paths):
        still = float(np.ptp(path.desired, axis=0).max()) < 1e-9
        axes.plot(
            *view.project(path.desired),
            color=palette.DESIRED,
            linewidth=3.6,
            marker="o" if still else "",
            markersize=9.0,
            zorder=2.2,
            label=_desired_label(path.axes, view) if place == 0 else None,
        )
    for place, path in enumerate(paths):
        who = path.name if len(paths) > 1 else ""
        _draw_track(axes, view, path.actual, place, plain(f"{who} actual".strip()))
    if not paths:
        ends = end_points(rollout)
        for k in range(ends.shape[1]):
            _draw_track(axes, view, ends[:, k], k, "end of the robot" if k == 0 else None)
        note(axes, "no task leads a point")
    _draw_obstacles(axes, view, rollout)
    size = float(np.ptp(everything(rollout), axis=0).max())
    fit(axes, view, _seen(rollout), least=0.02 * size)
    if legend:
        legend_below(axes)


def _draw_track(
    axes: Axes, view: View, points: Array, place: int, label: str | None
) -> None:
    color = _ACTUAL[place % len(_ACTUAL)]
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
    found = obstacles(rollout)
    for place, obstacle in enumerate(found):
        center, radius = obstacle.center, obstacle.radius
        moves = float(np.ptp(center, axis=0).max()) > 1e-9
        if moves:
            draw_ball(axes, view, center[0], radius, filled=False)
        draw_ball(axes, view, center[-1], radius)
        axes.plot(
            *view.project(center),
            color=palette.OBSTACLE,
            linewidth=1.1,
            linestyle=":",
            marker="" if moves else "+",
            zorder=2.1,
            label=("obstacle" if len(found) == 1 else "obstacles") if place == 0 else None,
        )


def _desired_label(axes: str, view: View) -> str:
    """Return the label; with the tracked axes if some in the view are not tracked."""
    return f"desired ({axes})" if set(view.names) - set(axes) else "desired"


def _seen(rollout: Rollout, *, balls: bool = True) -> Array:
    """Return points that enclose paths and obstacles, shape (K, 3) [m]."""
    points: list[Array] = []
    for path in task_paths(rollout):
        points += [path.desired, path.actual]
    if not points:
        points.append(end_points(rollout).reshape(-1, 3))
    for obstacle in obstacles(rollout):
        corners = ball(obstacle.center, obstacle.radius)
        points += corners if balls else [obstacle.center]
    return np.concatenate(points)
