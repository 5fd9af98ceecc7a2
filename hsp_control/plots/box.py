"""Three axes with numbers, in space: a box around what is drawn, seen from a slant."""

from itertools import product

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from hsp_control.plots import palette
from hsp_control.plots.views import View
from hsp_control.robot import Array

# For each axis: the edge that bears its numbers, as sides of the others (0 low, 1 high),
# where its numbers stand off the edge, and where its name does [pt]. The eye stands at
# high x, low y and above; these edges lie in front and at the left.
_EDGES: tuple[tuple[tuple[int, int], tuple[int, int], str, tuple[int, int]], ...] = (
    ((0, 0), (-3, -4), "right", (-18, -19)),
    ((1, 0), (4, -4), "left", (24, -17)),
    ((0, 0), (-5, 0), "right", (-36, 0)),
)
_WALLS = ((0, 0), (1, 1), (2, 0))
"""The sides behind everything: low x, high y and the floor."""


def draw_box(axes: Axes, view: View, lower: Array, upper: Array) -> None:
    """Draw the walls behind a box with a grid, and numbers along three edges.

    Args:
        axes: The axes; their own are switched off.
        view: The view from the slant.
        lower: Lowest corner, shape (3,) [m].
        upper: Highest corner, shape (3,) [m].
    """
    axes.set_axis_off()
    ends = np.stack([lower, upper])
    ticks = [_ticks(view, ends, axis) for axis in range(3)]
    for normal, side in _WALLS:
        _draw_wall(axes, view, ends, ticks, normal, side)
    for axis in range(3):
        _draw_numbers(axes, view, ends, ticks[axis], axis)


def _ticks(view: View, ends: Array, axis: int) -> Array:
    """Return round numbers along an edge, the fewer the shorter it is on the page."""
    lengths = np.ptp(ends, axis=0) * np.linalg.norm(view.rows, axis=0)
    count = max(1, round(4.0 * float(lengths[axis] / lengths.max())))
    low, high = ends[:, axis]
    ticks = np.asarray(MaxNLocator(count, steps=[1, 2, 5, 10]).tick_values(low, high))
    return np.round(ticks[(ticks >= low) & (ticks <= high)], 9)


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


def _draw_numbers(
    axes: Axes, view: View, ends: Array, ticks: Array, axis: int
) -> None:
    sides, offset, side, name_offset = _EDGES[axis]
    others = [other for other in range(3) if other != axis]
    edge = ends.copy()
    for other, chosen in zip(others, sides, strict=True):
        edge[:, other] = ends[chosen, other]
    axes.plot(*view.project(edge), color=palette.MUTED, linewidth=0.7, zorder=0.7)
    labels = [(tick, f"{tick:g}", offset, side, 8.0) for tick in ticks]
    name = f"{'xyz'[axis]} [m]"
    labels.append((float(ends[:, axis].mean()), name, name_offset, "center", 9.0))
    for where, text, shift, align, size in labels:
        point = edge[0].copy()
        point[axis] = where
        x, y = view.project(point)
        axes.annotate(
            text,
            (float(x), float(y)),
            xytext=shift,
            textcoords="offset points",
            ha=align,
            va="center" if axis == 2 else "top",
            rotation=90.0 if axis == 2 and size > 8.0 else 0.0,
            fontsize=size,
            annotation_clip=False,
        )


def corners(lower: Array, upper: Array) -> Array:
    """Return a box's corners, shape (8, 3)."""
    ends = np.stack([lower, upper])
    return np.array([[ends[i, 0], ends[j, 1], ends[k, 2]] for i, j, k in product((0, 1), repeat=3)])
