"""Views of the world: along one of its axes, or oblique."""

from math import cos, radians, sin
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from hsp_control.common.arrays import Array

FLAT = 1e-6  # depth over width below which motion counts as planar
AZIMUTH, ELEVATION = -60.0, 22.0  # direction of the eye in an oblique view [deg]


class View(NamedTuple):
    """A parallel projection onto the figure's plane."""

    rows: Array  # the projection matrix, (2, 3)
    names: str  # the world axes of the plane, such as ``"xy"``; "" for an oblique view

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return x and y in the figure's plane, each of shape ``points.shape[:-1]``."""
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
