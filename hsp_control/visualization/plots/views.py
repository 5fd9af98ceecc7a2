"""From which side the world is drawn: along one of its axes, or from a slant."""

from math import cos, radians, sin
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from hsp_control.common.arrays import Array

FLAT = 1e-6
"""Depth over width below which motion is said to lie in a plane."""
AZIMUTH, ELEVATION = -60.0, 22.0
"""Where the eye of a slant view stands [deg]."""


class View(NamedTuple):
    """A parallel projection onto the page.

    Attributes:
        rows: What a point is multiplied with, shape (2, 3).
        names: The world axes that the page's axes are, ``"xy"``; none for a slant view.
    """

    rows: Array
    names: str

    def project(self, points: Array) -> tuple[Array, Array]:
        """Return x and y on the page, each of the shape of ``points[..., 0]``."""
        page = points @ self.rows.T
        return page[..., 0], page[..., 1]


def plane(names: str) -> View:
    """Return the view onto the plane of two world axes, such as ``"xz"``."""
    return View(np.eye(3)[["xyz".index(name) for name in names]], names)


def slant() -> View:
    """Return the view from above the front of the scene, z upwards."""
    a, e = radians(AZIMUTH), radians(ELEVATION)
    right = (-sin(a), cos(a), 0.0)
    up = (-sin(e) * cos(a), -sin(e) * sin(a), cos(e))
    return View(np.array([right, up]), "")


def best_plane(points: Array) -> str:
    """Return the two world axes along which points spread most, such as ``"xy"``.

    Args:
        points: Shape (K, 3).
    """
    spread = np.ptp(points, axis=0)
    depth = 2 - int(np.argmin(spread[::-1]))  # the last axis where several spread least
    return "xyz".replace("xyz"[depth], "")


def is_flat(points: Array, depth: float = FLAT) -> bool:
    """Say whether points lie in a plane across a world axis.

    Args:
        points: Shape (K, 3).
        depth: Their depth over their width that still counts as flat.
    """
    spread = np.ptp(points, axis=0)
    return bool(spread.min() <= depth * spread.max())


def view_of(points: Array) -> View:
    """Return the view onto the plane that points lie in, or from a slant.

    Args:
        points: Shape (K, 3).
    """
    return plane(best_plane(points)) if is_flat(points) else slant()


def fit(
    axes: Axes, view: View, points: Array, least: float = 0.0, margin: float = 0.06
) -> None:
    """Set limits around points, equal scales, and labels if there are world axes.

    Args:
        axes: The axes.
        view: The view.
        points: What is to be seen, shape (K, 3).
        least: Width that is shown at least [m], so as not to magnify rounding.
        margin: Room around them, relative to the greater width.
    """
    x, y = view.project(points)
    widest = max(float(np.ptp(x)), float(np.ptp(y)), least, 1e-6)
    for set_limits, coordinate in ((axes.set_xlim, x), (axes.set_ylim, y)):
        middle = 0.5 * float(coordinate.min() + coordinate.max())
        half = 0.5 * max(float(np.ptp(coordinate)), least) + margin * widest
        set_limits(middle - half, middle + half)
    axes.set_aspect("equal")
    axes.locator_params(nbins=6)
    if view.names:
        axes.set_xlabel(f"{view.names[0]} [m]")
        axes.set_ylabel(f"{view.names[1]} [m]")
