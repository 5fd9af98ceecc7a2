"""Three axes with tick labels: a box around an oblique view."""

from itertools import product
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator

from hsp_control.common.arrays import Array
from hsp_control.visualization import palette
from hsp_control.visualization.plots.views import View


class _Edge(NamedTuple):
    """The edge with the tick labels of an axis; the eye is at high x, low y, high z."""

    sides: tuple[int, int]  # the edge, as sides of the two other axes: 0 low, 1 high
    shift: tuple[float, float]  # offset of the labels from the edge [pt]
    align: str  # horizontal alignment of the labels


_EDGES = (
    _Edge((0, 0), (-3.0, -4.0), "right"),
    _Edge((1, 0), (4.0, -4.0), "left"),
    _Edge((0, 0), (-5.0, 0.0), "right"),
)
_DIGIT_WIDTH = 4.8
"""Width of a digit [pt]."""
_NARROWEST = 115.0
"""Width or height, the larger one, of the smallest box in a figure [pt]."""
_HEIGHT = 11.0
"""Height of a line of tick labels [pt]."""
_WALLS = ((0, 0), (1, 1), (2, 0))
"""The sides behind the scene, (axis, side): low x, high y and the floor."""


def draw_box(axes: Axes, view: View, lower: Array, upper: Array) -> None:
    """Draw the back walls of a box with a grid, and tick labels along three edges.

    Shapes: lower (3,) [m], upper (3,) [m].
    """
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
    while len(inside) < 2 and count < 10:  # one tick alone gives no scale
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
    wide = _DIGIT_WIDTH * max((len(f"{tick:g}") for tick in ticks), default=0)
    for stride in range(1, max(len(ticks) - 1, 1)):
        kept = ticks[::stride]
        across, up = direction * (kept[1] - kept[0]) if len(kept) > 1 else (wide, 0.0)
        if across >= wide or up >= _HEIGHT:
            return np.asarray(kept)
    return np.asarray(ticks[:: max(len(ticks) - 1, 1)])


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
        xytext=(
            (-16.0, -18.0),
            (8.0 + 0.5 * widest, -16.0),
            (-9.0 - widest, 0.0),
        )[axis],
        textcoords="offset points",
        ha=("right", "left", "right")[axis],
        va="center" if upright else "top",
        rotation=90.0 if upright else 0.0,
    )


def corners(lower: Array, upper: Array) -> Array:
    """Return the corners of a box, shape (8, 3)."""
    return np.array(list(product(*np.stack([lower, upper]).T)))
