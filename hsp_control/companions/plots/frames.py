"""The robot at selected times (frames): one plot each, or all in one plot."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patheffects import withStroke

from hsp_control.common.arrays import Array
from hsp_control.companions.plots import palette
from hsp_control.companions.plots.world import (
    View,
    center_points,
    draw_axis_directions,
    draw_obstacle,
    draw_shadow,
    draw_skeleton,
    enclosing_points,
    fit,
    logged_obstacles,
    parents,
    task_paths,
    view_of,
)
from hsp_control.simulation import Rollout

_BEYOND = 1.5  # distance of a number from the last point, over the size of its letters
_LABELS, _TITLE, _BETWEEN = 0.5, 0.25, 0.1  # beside and between frames [in]
MAX_TICKS = 10  # with more frames, their times are not the ticks of the time scale


def draw_frame(axes: Axes, rollout: Rollout, row: int, *, key: bool = True) -> None:
    """Draw robot and obstacles at one row, and the desired paths; ``key``: a scale."""
    scene = _Surroundings.of(rollout)
    skeleton, tree = rollout["skeleton"][row], parents(rollout)
    if not scene.view.names:
        draw_shadow(axes, scene.view, skeleton, tree, scene.floor)
    _draw_paths(axes, scene.view, rollout, 1.6)
    for obstacle in logged_obstacles(rollout):
        draw_obstacle(axes, scene.view, obstacle, row)
    draw_skeleton(axes, scene.view, skeleton, tree)
    scene.finish(axes, shadows=True, key=key)
    axes.locator_params(nbins=3)  # a frame has little space
    axes.set_title(
        f"t = {rollout.t[row]:.2f} s", fontsize=8.5, fontweight="normal", pad=3.0
    )


def draw_frames(
    axes: Sequence[Axes],
    rollout: Rollout,
    rows: Sequence[int],
    *,
    short: bool = False,
) -> None:
    """Draw numbered frames side by side; unused axes are switched off.

    ``short``: titles have the number and the time alone, where there is little space.
    """
    for place, one in enumerate(axes):
        if place < len(rows):
            draw_frame(one, rollout, rows[place], key=False)
            # Before the time: at the right it would look like the next frame's.
            title = one.get_title(loc="left")
            title = title.removeprefix("t = ") if short else f" {title}"
            number = rf"$\mathbf{{{place + 1}}}$  {title}"
            one.set_title(number, fontsize=8.5, fontweight="normal", pad=3.0)
        else:
            one.set_axis_off()


def draw_superimposed(
    axes: Axes,
    rollout: Rollout,
    rows: Sequence[int],
    *,
    numbered: bool = True,
    letter: float = 0.035,
) -> None:
    """Draw the robot at all rows in one plot; later rows are darker.

    ``letter``: the width and height of a letter of a frame's number, over the size of
    the scene; numbers that would overlap are one text.
    """
    scene, tree = _Surroundings.of(rollout), parents(rollout)
    _draw_paths(axes, scene.view, rollout, 2.2)
    times = rollout.t[list(rows)]
    start, end = float(times.min()), float(times.max())
    for place, row in enumerate(rows):
        age = float(rollout.t[row] - start) / (end - start) if end > start else 1.0
        pale = palette.blend(palette.OBSTACLE_EARLY, palette.OBSTACLE, age)
        for obstacle in logged_obstacles(rollout):
            if obstacle.moves or place == len(rows) - 1:
                draw_obstacle(axes, scene.view, obstacle, row, color=pale, zorder=1.9)
        link = palette.blend(palette.EARLY, palette.LATE, age)
        joint = palette.blend(link, palette.INK, 0.4)
        points = rollout["skeleton"][row]
        zorder = 3.0 + 0.2 * place
        draw_skeleton(
            axes, scene.view, points, tree, link=link, joint=joint, zorder=zorder
        )
    if numbered:
        near = letter * float(np.ptp(scene.view.project(scene.points), axis=1).max())
        for row, text in _numbers(scene.view, rollout, tree, rows, near):
            _number(axes, scene.view, rollout["skeleton"][row], tree, text)
    scene.finish(axes, shadows=False, key=True)
    if end > start:
        _time_bar(axes, start, end, times.tolist())


def columns_for(rollout: Rollout, count: int, width: float, height: float) -> int:
    """Return the number of columns for which the frames are largest.

    ``width`` and ``height`` are those of all frames with their titles and the axes'
    labels [in].
    """
    scene = _Surroundings.of(rollout)
    page = scene.view.project(scene.shown(shadows=True))
    w, h = (float(np.ptp(coordinate)) + 1e-9 for coordinate in page)

    def scale(columns: int) -> float:
        rows = -(-count // columns)
        filled = count / (rows * columns)
        across = (width - _LABELS) / columns - _BETWEEN
        down = (height - _LABELS) / rows - _TITLE
        return filled * min(across / w, down / h)

    return max(range(1, count + 1), key=scale)


class _Surroundings(NamedTuple):
    """View, extent and floor that all frames of a log share."""

    view: View
    points: Array  # points that enclose robot, paths and obstacles [m], (K, 3)
    floor: float  # height of the floor [m]: 0, or that of the lowest point below it

    @classmethod
    def of(cls, rollout: Rollout) -> Self:
        points = enclosing_points(rollout)
        view = view_of(center_points(rollout))
        return cls(view, points, min(0.0, float(points[:, 2].min())))

    def shown(self, *, shadows: bool) -> Array:
        """Return the points, and their projections on the floor [m], shape (K, 3)."""
        if self.view.names or not shadows:
            return self.points
        projected = self.points.copy()
        projected[:, 2] = self.floor
        return np.concatenate([self.points, projected])

    def finish(self, axes: Axes, *, shadows: bool, key: bool) -> None:
        """Set limits and labels; in an oblique view draw axis directions instead."""
        points = self.shown(shadows=shadows)
        if not self.view.names:
            axes.set_axis_off()
            if key:
                points = np.concatenate([points, self._draw_key(axes, points)])
        fit(axes, self.view, points, min_width=1e-3)

    def _draw_key(self, axes: Axes, points: Array) -> Array:
        """Draw axis directions at the lower left; return points that enclose them."""
        x, y = self.view.project(points)
        length = 0.2 * max(float(np.ptp(x)), float(np.ptp(y)))
        corner = np.array([float(x.min()), float(y.min()) - 1.5 * length])
        origin = self.view.rows.T @ corner
        draw_axis_directions(axes, self.view, origin, length)
        return np.array([origin, origin - 0.3 * length * self.view.rows[1]])


def _numbers(
    view: View, rollout: Rollout, tree: Sequence[int], rows: Sequence[int], near: float
) -> Iterator[tuple[int, str]]:
    """Yield a row and its frames' numbers; numbers that would overlap are one text."""
    points = [rollout["skeleton"][list(rows), k] for k in (-1, tree[-1])]
    ends, before = (np.column_stack(view.project(each)) for each in points)
    lengths = np.linalg.norm(ends - before, axis=1, keepdims=True)
    ends += _BEYOND * near * (ends - before) / np.maximum(lengths, 1e-12)
    groups: list[list[int]] = []
    for place in range(len(rows)):
        group = [place]
        # A text that grows with a frame's number may reach a further one.
        while hit := [g for g in groups if _overlap(ends, g, group, near)]:
            groups = [g for g in groups if g not in hit]
            group = sorted(sum(hit, group))
        groups.append(group)
    for group in sorted(groups):
        yield rows[group[-1]], _ranges(group)


def _overlap(ends: Array, first: list[int], second: list[int], near: float) -> bool:
    """Return whether the numbers of two groups of frames would overlap."""
    across, up = np.abs(ends[first[-1]] - ends[second[-1]])
    wide = 0.5 * near * (len(_ranges(first)) + len(_ranges(second)))
    return bool(across < wide and up < near)


def _ranges(group: list[int]) -> str:
    """Return ascending places, from 0, as numbers from 1: ``1-3, 5`` with a dash."""
    starts = [k for k in group if k - 1 not in group]
    stops = [k for k in group if k + 1 not in group]
    spans = zip(starts, stops, strict=True)
    return ", ".join(f"{a + 1}–{b + 1}" if b > a else f"{a + 1}" for a, b in spans)


def _number(
    axes: Axes, view: View, points: Array, tree: Sequence[int], text: str
) -> None:
    """Write frames' numbers beyond the last point, in the direction of its link."""
    (x, y), (x0, y0) = (view.project(points[k]) for k in (-1, tree[-1]))
    along = np.array([float(x - x0), float(y - y0)])
    length = float(np.linalg.norm(along))
    offset = along / length if length > 0.0 else np.array([0.0, 1.0])
    axes.annotate(
        text,
        (float(x), float(y)),
        xytext=tuple(8.0 * offset),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=8.4,
        fontweight="bold",
        color=palette.INK,
        zorder=9.0,
        path_effects=[withStroke(linewidth=2.0, foreground=palette.PAPER)],
    )


def _draw_paths(axes: Axes, view: View, rollout: Rollout, width: float) -> None:
    for path in task_paths(rollout):
        page = view.project(path.desired)
        axes.plot(*page, color=palette.DESIRED, linewidth=width, zorder=1.8)


def _time_bar(axes: Axes, start: float, end: float, ticks: list[float]) -> None:
    scale = LinearSegmentedColormap.from_list("time", [palette.EARLY, palette.LATE])
    figure = axes.get_figure(root=False)
    assert figure is not None
    beside = axes.inset_axes((1.08, 0.0, 0.035, 1.0))
    bar = figure.colorbar(ScalarMappable(Normalize(start, end), scale), cax=beside)
    bar.set_label("time [s]")
    if len(ticks) <= MAX_TICKS:
        bar.set_ticks(ticks, labels=[f"{tick:.3g}" for tick in ticks])
    bar.outline.set_visible(False)
