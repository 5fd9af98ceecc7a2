"""Things in the world: an arm, its shadow, an obstacle, the directions of the axes."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from hsp_control.common.arrays import Array
from hsp_control.visualization import palette
from hsp_control.visualization.plots.bodies import Body
from hsp_control.visualization.plots.views import View


def draw_arm(
    axes: Axes,
    view: View,
    points: Array,
    parents: Sequence[int],
    *,
    link: str = palette.LINK,
    joint: str = palette.JOINT,
    width: float = 3.0,
    zorder: float = 3.0,
) -> None:
    """Draw links from every point to its parent; joints, roots (square) and ends.

    Args:
        axes: The axes.
        view: The view.
        points: The skeleton at one time, shape (K, 3) [m].
        parents: Index of every point's parent, -1 for none.
        link: Colour of the links.
        joint: Colour of joints and roots, and of the rim of ends.
        width: Width of the links [pt].
        zorder: Where it lies above other things.
    """
    axes.plot(
        *view.project(bones(points, parents)),
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
    """Draw an arm's shadow on the floor, and a plumb line from each root.

    Args:
        axes: The axes.
        view: The view.
        points: The skeleton at one time, shape (K, 3) [m].
        parents: Index of every point's parent, -1 for none.
        floor: The floor's height [m].
    """
    fallen = points.copy()
    fallen[:, 2] = floor
    axes.plot(
        *view.project(bones(fallen, parents)),
        color=palette.SHADOW,
        linewidth=2.5,
        zorder=1.0,
    )
    for k, parent in enumerate(parents):
        if parent < 0:
            plumb = np.stack([points[k], fallen[k]])
            axes.plot(
                *view.project(plumb), color=palette.LINK, linewidth=0.8, linestyle=":"
            )


def draw_body(
    axes: Axes,
    view: View,
    body: Body,
    row: int,
    *,
    color: str = palette.OBSTACLE,
    filled: bool = True,
    zorder: float = 2.0,
    label: str | None = None,
) -> None:
    """Draw an obstacle's outline; a half-space only where it is seen edge-on.

    What is larger than the robot is drawn as a mere line, behind all else.

    Args:
        axes: The axes.
        view: The view.
        body: The obstacle.
        row: The row.
        color: Its colour.
        filled: False: a dashed outline, as for a ball that only holds a body.
        zorder: Where it lies above other things.
        label: What the legend calls it.
    """
    looks: dict[str, Any] = {
        "facecolor": "none"
        if body.vast or not (filled and body.exact)
        else f"{color}73",
        "edgecolor": f"{color}73" if body.vast else color,
        "linewidth": 1.0,
        "linestyle": "-" if filled and body.exact else (0, (3, 2)),
        "zorder": 0.9 if body.vast else zorder,
        "label": label,
    }
    if len(body.points) == 1:
        x, y = view.project(body.placed(row)[0])
        axes.add_patch(Circle((float(x), float(y)), body.radius, **looks))
    elif len(body.points):
        axes.add_patch(Polygon(body.outline(view, row), **looks))
    else:
        _draw_half_space(axes, view, body, row, looks)


def _draw_half_space(
    axes: Axes, view: View, body: Body, row: int, looks: dict[str, Any]
) -> None:
    normal = view.rows @ body.rotation[row, :, 2]
    if float(np.linalg.norm(normal)) < 1.0 - 1e-6:
        return
    far = 1e3  # beyond every picture [m]
    point = view.rows @ body.center[row]
    along = far * np.array([-normal[1], normal[0]])
    edge = np.stack([point - along, point + along])
    corners = np.concatenate([edge, edge[::-1] - far * normal])
    looks["facecolor"] = palette.SHADOW
    axes.add_patch(Polygon(corners, **looks))


def draw_directions(axes: Axes, view: View, origin: Array, length: float) -> None:
    """Draw the world's axes as three strokes of a round length that is written there.

    Args:
        axes: The axes.
        view: The view.
        origin: Where they meet, shape (3,) [m].
        length: About how long they are [m].
    """
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


def bones(points: Array, parents: Sequence[int]) -> Array:
    """Return all links as one line that NaN breaks between them, shape (3 links, 3)."""
    gap = np.full(3, np.nan)
    lines = [
        (points[parent], points[k], gap)
        for k, parent in enumerate(parents)
        if parent >= 0
    ]
    return np.array(lines).reshape(-1, 3)
