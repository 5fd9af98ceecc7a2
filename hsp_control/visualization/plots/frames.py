"""The robot at selected times (frames): one plot each, or all in one plot."""

from collections.abc import Sequence
from typing import NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LinearSegmentedColormap, Normalize
from matplotlib.patheffects import withStroke

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.visualization import palette
from hsp_control.visualization.plots.logged_geometry import (
    center_points,
    enclosing_points,
    parents,
    task_paths,
)
from hsp_control.visualization.plots.obstacles import logged_obstacles
from hsp_control.visualization.plots.views import View, fit, view_of
from hsp_control.visualization.plots.world_drawing import (
    draw_axis_directions,
    draw_obstacle,
    draw_shadow,
    draw_skeleton,
)

MAX_TICKS = 10
"""With more frames, their times are not the ticks of the time scale."""


def draw_frame(axes: Axes, rollout: Rollout, row: int, *, key: bool = True) -> None:
    """Draw the robot and the obstacles at one row, and the tasks' whole desired paths.

    Planar motion is drawn in its plane, spatial motion in an oblique view with a shadow
    on the floor.

    Args:
        axes: The axes.
        rollout: The log.
        row: The row.
        key: In an oblique view, draw the directions of the world's axes and a scale.
    """
    scene = _Scene.of(rollout)
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


def draw_frames(axes: Sequence[Axes], rollout: Rollout, rows: Sequence[int]) -> None:
    """Draw numbered frames side by side; unused axes are switched off.

    Args:
        axes: One for each row, in reading order.
        rollout: The log.
        rows: The rows.
    """
    for place, one in enumerate(axes):
        if place < len(rows):
            draw_frame(one, rollout, rows[place], key=False)
            one.set_title(str(place + 1), loc="right", fontsize=8.5, pad=3.0)
        else:
            one.set_axis_off()


def draw_superimposed(
    axes: Axes, rollout: Rollout, rows: Sequence[int], *, numbered: bool = True
) -> None:
    """Draw the robot at all rows in one plot; later rows are darker.

    Args:
        axes: The axes.
        rollout: The log.
        rows: The rows.
        numbered: Write the frames' numbers at the robot's end.
    """
    scene, tree = _Scene.of(rollout), parents(rollout)
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
            _number(axes, scene.view, points, tree, place + 1)
    scene.finish(axes, shadows=False, key=True)
    if end > start:
        _time_bar(axes, start, end, times.tolist())


def columns_for(rollout: Rollout, count: int, width: float, height: float) -> int:
    """Return the number of columns for which the frames are largest.

    Args:
        rollout: The log.
        count: Number of frames.
        width: Width of the available space, in any unit.
        height: Its height, in the same unit.
    """
    scene = _Scene.of(rollout)
    page = scene.view.project(scene.shown(shadows=True))
    w, h = (float(np.ptp(coordinate)) + 1e-9 for coordinate in page)

    def scale(columns: int) -> float:
        rows = -(-count // columns)
        filled = count / (rows * columns)
        return filled * min(width / columns / w, height / rows / h)

    return max(range(1, count + 1), key=scale)


class _Scene(NamedTuple):
    """View, extent and floor that all frames of a log share.

    Attributes:
        view: The view.
        points: Points that enclose robot, paths and obstacles [m], shape (K, 3).
        floor: Height of the floor [m]: 0, or that of the lowest point below it.
    """

    view: View
    points: Array
    floor: float

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


def _number(
    axes: Axes, view: View, points: Array, tree: Sequence[int], number: int
) -> None:
    """Write a frame's number beyond the last point, in the direction of its link."""
    (x, y), (x0, y0) = (view.project(points[k]) for k in (-1, tree[-1]))
    along = np.array([float(x - x0), float(y - y0)])
    length = float(np.linalg.norm(along))
    offset = along / length if length > 0.0 else np.array([0.0, 1.0])
    axes.annotate(
        str(number),
        (float(x), float(y)),
        xytext=tuple(8.0 * offset),
        textcoords="offset points",
        ha="center",
        va="center",
        fontsize=7.5,
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
    beside = axes.inset_axes((1.04, 0.0, 0.035, 1.0))
    bar = figure.colorbar(ScalarMappable(Normalize(start, end), scale), cax=beside)
    bar.set_label("time [s]")
    if len(ticks) <= MAX_TICKS:
        bar.set_ticks(ticks, labels=[f"{tick:.3g}" for tick in ticks])
    bar.outline.set_visible(False)
