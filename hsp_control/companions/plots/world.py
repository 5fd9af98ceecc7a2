"""The world of a log in figures: views, skeletons, obstacles, shadows, directions."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product
from math import cos, radians, sin
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from hsp_control.common.arrays import Array
from hsp_control.companions.plots import palette
from hsp_control.companions.plots.log_series import TaskPath, finite_points, task_path
from hsp_control.simulation import Rollout
from hsp_control.simulation.measures import task_names

FLAT = 1e-6  # depth over width below which motion is treated as planar
AZIMUTH, ELEVATION = -60.0, 22.0  # direction of the eye in an oblique view [deg]


class View(NamedTuple):
    """A parallel projection onto the figure's plane."""

    rows: Array  # the projection matrix, (2, 3)
    names: str  # the world axes of the plane, such as ``"xy"``; "" for an oblique view

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return x and y in the figure's plane, of shape ``points.shape[:-1]``."""
        page = points @ self.rows.T
        return page[..., 0], page[..., 1]


def plane(names: str) -> View:
    """Return the view onto the plane of two world axes, such as ``"xz"``."""
    return View(np.eye(3)[["xyz".index(name) for name in names]], names)


def oblique() -> View:
    """Return the oblique view from the front and above, z upwards."""
    a, e = radians(AZIMUTH), radians(ELEVATION)
    right = (-sin(a), cos(a), 0.0)
    up = (-sin(e) * cos(a), -sin(e) * sin(a), cos(e))
    return View(np.array([right, up]), "")


def best_plane(points: Array) -> str:
    """Return the two world axes with the largest spread of points, such as ``"xy"``."""
    spread = np.ptp(points, axis=0)
    # The last axis of those with the smallest spread.
    depth = 2 - int(np.argmin(spread[::-1]))
    return "xyz".replace("xyz"[depth], "")


def is_flat(points: Array, depth: float = FLAT) -> bool:
    """Return whether points lie in a plane normal to a world axis; points (K, 3)."""
    spread = np.ptp(points, axis=0)
    return bool(spread.min() <= depth * spread.max())


def view_of(points: Array) -> View:
    """Return the view onto the plane of flat points, or else the oblique view."""
    return plane(best_plane(points)) if is_flat(points) else oblique()


def fit(
    axes: Axes, view: View, points: Array, min_width: float = 0.0, margin: float = 0.06
) -> None:
    """Set limits around points (K, 3) [m], equal scales, and the axes' labels."""
    x, y = view.project(points)
    widest = max(float(np.ptp(x)), float(np.ptp(y)), min_width, 1e-6)
    for set_limits, coordinate in ((axes.set_xlim, x), (axes.set_ylim, y)):
        middle = 0.5 * float(coordinate.min() + coordinate.max())
        half = 0.5 * max(float(np.ptp(coordinate)), min_width) + margin * widest
        set_limits(middle - half, middle + half)
    axes.set_aspect("equal")
    axes.locator_params(nbins=6)
    if view.names:
        axes.set_xlabel(f"{view.names[0]} [m]")
        axes.set_ylabel(f"{view.names[1]} [m]")


_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
_DISK = np.column_stack([np.cos(_CIRCLE), np.sin(_CIRCLE)])


class LoggedObstacle(NamedTuple):
    """An obstacle during a run: the convex hull of balls around moving points."""

    name: str
    center: Array  # the origin of its frame [m], (N, 3)
    rotation: Array  # the rotation of its frame, world ← obstacle, (N, 3, 3)
    # The points in its frame [m], (K, 3); K = 0: a half-space, below its x-y plane.
    points: Array
    radius: float  # the balls' radius [m]
    exact: bool  # false if only a bounding ball is known
    # Whether it is larger than the robot, such as a floor; figures need not show all of
    # it.
    oversized: bool

    @property
    def moves(self) -> bool:
        """Whether it translates or rotates."""
        travel = np.ptp(self.center, axis=0).max() + np.ptp(self.rotation, axis=0).max()
        return bool(travel > 1e-9)

    def world_points(self, row: int) -> Array:
        """Return its points in the world at a row [m], shape (K, 3)."""
        return np.asarray(self.center[row] + self.points @ self.rotation[row].T)

    def enclosing_points(self) -> Array:
        """Return points that enclose it at all rows [m], shape (M, 3)."""
        low, high = self.points.min(axis=0), self.points.max(axis=0)
        extreme = corners(low, high) if len(self.points) > 8 else self.points
        rotated = extreme @ np.swapaxes(self.rotation, 1, 2)  # (N, K, 3)
        placed = (rotated + self.center[:, None]).reshape(-1, 3)
        return np.concatenate([placed - self.radius, placed + self.radius])

    def outline(self, view: View, row: int) -> Array:
        """Return its outline in the view's plane at a row [m], shape (P, 2)."""
        from scipy.spatial import ConvexHull  # here: SciPy takes long to import

        page = np.column_stack(view.project(self.world_points(row)))
        # A flat shape, seen edge-on.
        thinnest = 1e-4 * float(np.ptp(page, axis=0).max())
        disk = max(self.radius, thinnest) * _DISK
        cloud = (page[:, None] + disk).reshape(-1, 2)
        return np.asarray(cloud[ConvexHull(cloud).vertices])


def logged_obstacles(rollout: Rollout) -> list[LoggedObstacle]:
    """Return the obstacles of a log."""
    return [
        _logged_obstacle(rollout, name, about)
        for name, about in rollout.meta.get("obstacles", {}).items()
    ]


def _logged_obstacle(
    rollout: Rollout, name: str, about: Mapping[str, Any]
) -> LoggedObstacle:
    center = rollout[f"obstacle.{name}"]
    rotation = np.broadcast_to(np.eye(3), (len(center), 3, 3))
    if f"obstacle.{name}.quaternion" in rollout and len(center):
        from scipy.spatial.transform import Rotation  # here, as above

        orientation = Rotation.from_quat(rollout[f"obstacle.{name}.quaternion"])
        rotation = orientation.as_matrix()
    points_of = _POINTS_OF_SHAPE.get(about.get("shape", ""))
    if points_of is None:
        points, radius = np.zeros((1, 3)), float(about["radius"])
    else:
        points, radius = points_of(about.get("parameters", {}))
    robot_size = float(np.ptp(rollout["skeleton"].reshape(-1, 3), axis=0).max())
    size = 2.0 * radius + float(np.ptp(points, axis=0).max()) if len(points) else np.inf
    oversized = size > 1.2 * robot_size
    return LoggedObstacle(
        name, center, rotation, points, radius, points_of is not None, oversized
    )


def corners(low: Array, high: Array) -> Array:
    """Return the corners of a box, shape (8, 3)."""
    return np.array(list(product(*np.stack([low, high]).T)))


def _capsule(about: Mapping[str, Any]) -> tuple[Array, float]:
    end = np.array([0.0, 0.0, 0.5 * float(about["length"])])
    return np.stack([-end, end]), float(about["radius"])


def _cylinder(about: Mapping[str, Any]) -> tuple[Array, float]:
    ring = float(about["radius"]) * _DISK
    half = np.full((len(ring), 1), 0.5 * float(about["length"]))
    return np.concatenate([np.hstack([ring, -half]), np.hstack([ring, half])]), 0.0


def _box(about: Mapping[str, Any]) -> tuple[Array, float]:
    half = 0.5 * np.asarray(about["size"], dtype=float)
    return corners(-half, half), 0.0


def _height_field(about: Mapping[str, Any]) -> tuple[Array, float]:
    heights = np.asarray(about["heights"], dtype=float)
    half = 0.5 * np.asarray(about["size"], dtype=float)
    low = np.array([*-half, heights.min()])
    return corners(low, np.array([*half, heights.max()])), 0.0


_POINTS_OF_SHAPE: dict[str, Callable[[Mapping[str, Any]], tuple[Array, float]]] = {
    "Sphere": lambda about: (np.zeros((1, 3)), float(about["radius"])),
    "Capsule": _capsule,
    "Cylinder": _cylinder,
    "Box": _box,
    "HeightField": _height_field,
    "PointCloud": lambda about: (
        np.asarray(about["points"], dtype=float),
        0.5 * float(about["resolution"]),
    ),
    "HalfSpace": lambda about: (np.zeros((0, 3)), 0.0),
}
"""Functions that return points and radius by shape; others, such as a mesh, are drawn
as a ball."""


def parents(rollout: Rollout) -> list[int]:
    """Return the index of every skeleton point's parent, -1 for none."""
    return [int(parent) for parent in rollout.meta["robot"]["skeleton_parents"]]


def task_paths(rollout: Rollout) -> list[TaskPath]:
    """Return the paths of all tasks that control a point."""
    paths = (task_path(rollout, name) for name in task_names(rollout))
    return [path for path in paths if path is not None]


def end_points(rollout: Rollout) -> Array:
    """Return the paths of the skeleton's ends [m], shape (N, ends, 3)."""
    inner = set(parents(rollout))
    ends = [k for k in range(rollout["skeleton"].shape[1]) if k not in inner]
    return rollout["skeleton"][:, ends]


def enclosing_points(rollout: Rollout) -> Array:
    """Return points that enclose robot, paths and obstacles [m], shape (K, 3)."""
    around = [
        obstacle.enclosing_points()
        for obstacle in logged_obstacles(rollout)
        if not obstacle.oversized
    ]
    return np.concatenate([*_robot_and_paths(rollout), *around])


def center_points(rollout: Rollout) -> Array:
    """Return points of robot and paths, and the obstacles' centres [m], shape (K, 3).

    They lie in a plane if all motion does; the obstacles' size does not matter.
    """
    middles = [
        obstacle.center
        for obstacle in logged_obstacles(rollout)
        if not obstacle.oversized
    ]
    return np.concatenate([*_robot_and_paths(rollout), *middles])


def _robot_and_paths(rollout: Rollout) -> list[Array]:
    paths = task_paths(rollout)
    desired = (finite_points(path.desired) for path in paths)
    return [rollout["skeleton"].reshape(-1, 3), *desired]


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
