"""Draws the robot's skeleton, its shadow, obstacles, and axis directions."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from hsp_control.common.arrays import Array
from hsp_control.visualization import palette
from hsp_control.visualization.plots.logged_geometry import LoggedObstacle
from hsp_control.visualization.plots.views import View


def draw_skeleton(
    axes: Axes,
    view: View,
    points: Array,
    parents: Sequence[int],
    *,
    link: str = palette.LINK,
    joint: str = palette.JOINT,
    zorder: float = 3.0,
) -> None:
    """Draw links from every point (K, 3) [m] to its parent, joints, roots and ends."""
    width = 3.0  # of the links [pt]
    axes.plot(
        *view.project(link_segments(points, parents)),
        color=link,
        linewidth=width,
        solid_joinstyle="round",
        zorder=zorder,
    )
    every = range(len(points))
    inner = [k for k in every if k in parents]
    ends = [k for k in every if k not in parents]
    roots = [k for k in every if parents[k] < 0]
    paper = palette.PAPER
    for chosen, marker, size, face, edge in (
        (inner, "o", 1.4, joint, paper),
        (roots, "s", 2.1, joint, paper),
        (ends, "o", 1.2, paper, joint),
    ):
        axes.plot(
            *view.project(points[chosen]),
            linestyle="none",
            marker=marker,
            markersize=size * width,
            markerfacecolor=face,
            markeredgecolor=edge,
            markeredgewidth=0.3 * width if chosen is ends else 0.15 * width,
            zorder=zorder + 0.1,
        )


def draw_shadow(
    axes: Axes, view: View, points: Array, parents: Sequence[int], floor: float
) -> None:
    """Draw a robot's shadow on the floor, and a vertical line from each root."""
    projected = points.copy()
    projected[:, 2] = floor
    axes.plot(
        *view.project(link_segments(projected, parents)),
        color=palette.SHADOW,
        linewidth=2.5,
        zorder=1.0,
    )
    for k, parent in enumerate(parents):
        if parent < 0:
            vertical = np.stack([points[k], projected[k]])
            axes.plot(
                *view.project(vertical),
                color=palette.LINK,
                linewidth=0.8,
                linestyle=":",
            )


def draw_obstacle(
    axes: Axes,
    view: View,
    obstacle: LoggedObstacle,
    row: int,
    *,
    color: str = palette.OBSTACLE,
    filled: bool = True,
    zorder: float = 2.0,
    label: str | None = None,
) -> None:
    """Draw an obstacle's outline; a half-space only if it is seen edge-on."""
    patch_style: dict[str, Any] = {
        "facecolor": "none"
        if obstacle.oversized or not (filled and obstacle.exact)
        else f"{color}73",
        "edgecolor": f"{color}73" if obstacle.oversized else color,
        "linewidth": 1.0,
        "linestyle": "-" if filled and obstacle.exact else (0, (3, 2)),
        "zorder": 0.9 if obstacle.oversized else zorder,
        "label": label,
    }
    if len(obstacle.points) == 1:
        x, y = view.project(obstacle.world_points(row)[0])
        axes.add_patch(Circle((float(x), float(y)), obstacle.radius, **patch_style))
    elif len(obstacle.points):
        axes.add_patch(Polygon(obstacle.outline(view, row), **patch_style))
    else:
        _draw_half_space(axes, view, obstacle, row, patch_style)


def _draw_half_space(
    axes: Axes,
    view: View,
    obstacle: LoggedObstacle,
    row: int,
    patch_style: dict[str, Any],
) -> None:
    normal = view.rows @ obstacle.rotation[row, :, 2]
    if float(np.linalg.norm(normal)) < 1.0 - 1e-6:
        return
    far = 1e3  # beyond every figure [m]
    point = view.rows @ obstacle.center[row]
    along = far * np.array([-normal[1], normal[0]])
    edge = np.stack([point - along, point + along])
    corners = np.concatenate([edge, edge[::-1] - far * normal])
    patch_style["facecolor"] = palette.SHADOW
    axes.add_patch(Polygon(corners, **patch_style))


def draw_axis_directions(axes: Axes, view: View, origin: Array, length: float) -> None:
    """Draw the world's axes as three lines of a round length, with that length."""
    power = 10.0 ** np.floor(np.log10(length))
    size = max(digit * power for digit in (1.0, 2.0, 5.0) if digit * power <= length)
    for axis, name in enumerate("xyz"):
        arm = float(size) * np.eye(3)[axis]
        stroke = view.project(np.stack([origin, origin + arm]))
        axes.plot(*stroke, color=palette.INK, linewidth=1.0, zorder=1.5)
        x, y = view.project(origin + 1.3 * arm)
        label = f"{name}  ({size:g} m)" if name == "z" else name
        axes.annotate(
            label,
            (float(x), float(y)),
            xytext=(-2.0, 0.0) if name == "z" else (0.0, 0.0),
            textcoords="offset points",
            fontsize=7.0,
            color=palette.MUTED,
            ha="left" if name == "z" else "center",
            va="center",
        )


def link_segments(points: Array, parents: Sequence[int]) -> Array:
    """Return all links as one line with NaN rows as breaks, shape (3 links, 3)."""
    gap = np.full(3, np.nan)
    lines = [
        (points[parent], points[k], gap)
        for k, parent in enumerate(parents)
        if parent >= 0
    ]
    return np.array(lines).reshape(-1, 3)
