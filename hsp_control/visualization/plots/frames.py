"""The robot at selected times: one picture each, or all in one."""

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
from hsp_control.visualization.plots.bodies import bodies
from hsp_control.visualization.plots.things import (
    draw_arm,
    draw_body,
    draw_directions,
    draw_shadow,
)
from hsp_control.visualization.plots.views import View, fit, view_of
from hsp_control.visualization.plots.world import (
    centers,
    everything,
    parents,
    task_paths,
)

MOST_TICKS = 10
"""More frames than that are not all named at the scale of time."""


def draw_frame(axes: Axes, rollout: Rollout, row: int, *, key: bool = True) -> None:
    """Draw the robot at one row, with obstacles there and the tasks' whole paths.

    A robot in a plane is drawn in it, one in space from a slant, with its shadow.

    Args:
        axes: The axes.
        rollout: The log.
        row: The row.
        key: From a slant, show which way the world's axes point, and a length.
    """
    scene = _Scene.of(rollout)
    skeleton, tree = rollout["skeleton"][row], parents(rollout)
    if not scene.view.names:
        draw_shadow(axes, scene.view, skeleton, tree, scene.floor)
    _draw_paths(axes, scene.view, rollout, 1.6)
    for body in bodies(rollout):
        draw_body(axes, scene.view, body, row)
    draw_arm(axes, scene.view, skeleton, tree)
    scene.finish(axes, shadows=True, key=key)
    axes.locator_params(nbins=3)  # a frame is small
    axes.set_title(
        f"t = {rollout.t[row]:.2f} s", fontsize=8.5, fontweight="normal", pad=3.0
    )


def draw_frames(axes: Sequence[Axes], rollout: Rollout, rows: Sequence[int]) -> None:
    """Draw a strip of numbered frames; axes that are left over are switched off.

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
    """Draw the robot at all rows in one picture, the later the darker.

    Args:
        axes: The axes.
        rollout: The log.
        rows: The rows.
        numbered: Number them at their ends; not where all ends are at one place.
    """
    scene, tree = _Scene.of(rollout), parents(rollout)
    _draw_paths(axes, scene.view, rollout, 2.2)
    times = rollout.t[list(rows)]
    start, end = float(times.min()), float(times.max())
    for place, row in enumerate(rows):
        age = float(rollout.t[row] - start) / (end - start) if end > start else 1.0
        pale = palette.blend(palette.OBSTACLE_EARLY, palette.OBSTACLE, age)
        for body in bodies(rollout):
            if body.moves or place == len(rows) - 1:
                draw_body(axes, scene.view, body, row, color=pale, zorder=1.9)
        link = palette.blend(palette.EARLY, palette.LATE, age)
        joint = palette.blend(link, palette.INK, 0.4)
        points = rollout["skeleton"][row]
        zorder = 3.0 + 0.2 * place
        draw_arm(axes, scene.view, points, tree, link=link, joint=joint, zorder=zorder)
        if numbered:
            _number(axes, scene.view, points, tree, place + 1)
    scene.finish(axes, shadows=False, key=True)
    if end > start:
        _time_bar(axes, start, end, times.tolist())


def columns_for(rollout: Rollout, count: int, width: float, height: float) -> int:
    """Return how many frames to put beside each other so that they come out largest.

    Args:
        rollout: The log.
        count: How many frames there are.
        width: Width of the space for them, in any unit.
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
    """What all frames of a log share.

    Attributes:
        view: The view.
        points: Points that enclose all that is ever to be seen, shape (K, 3) [m].
        floor: Height of the floor [m]: of the world's origin, or of what lies lower.
    """

    view: View
    points: Array
    floor: float

    @classmethod
    def of(cls, rollout: Rollout) -> Self:
        points = everything(rollout)
        view = view_of(centers(rollout))
        return cls(view, points, min(0.0, float(points[:, 2].min())))

    def shown(self, *, shadows: bool) -> Array:
        """Return the points, and where they fall on the floor, shape (K, 3) [m]."""
        if self.view.names or not shadows:
            return self.points
        fallen = self.points.copy()
        fallen[:, 2] = self.floor
        return np.concatenate([self.points, fallen])

    def finish(self, axes: Axes, *, shadows: bool, key: bool) -> None:
        """Set limits and labels, or show directions where there are none."""
        points = self.shown(shadows=shadows)
        if not self.view.names:
            axes.set_axis_off()
            if key:
                points = np.concatenate([points, self._draw_key(axes, points)])
        fit(axes, self.view, points, least=1e-3)

    def _draw_key(self, axes: Axes, points: Array) -> Array:
        """Show directions under the points, at the left; return what they take up."""
        x, y = self.view.project(points)
        length = 0.2 * max(float(np.ptp(x)), float(np.ptp(y)))
        corner = np.array([float(x.min()), float(y.min()) - 1.5 * length])
        origin = self.view.rows.T @ corner
        draw_directions(axes, self.view, origin, length)
        return np.array([origin, origin - 0.3 * length * self.view.rows[1]])


def _number(
    axes: Axes, view: View, points: Array, tree: Sequence[int], number: int
) -> None:
    """Write a frame's number beyond the last point, along the link that leads there."""
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
    if len(ticks) <= MOST_TICKS:
        bar.set_ticks(ticks, labels=[f"{tick:.3g}" for tick in ticks])
    bar.outline.set_visible(False)
