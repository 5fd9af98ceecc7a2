"""From which side points in the world are drawn: a plane, a slant view, or in space."""

from math import cos, radians, sin
from typing import NamedTuple

import numpy as np
from matplotlib.axes import Axes

from hsp_control.robot import Array

FLAT = 1e-6
"""Depth over width below which motion is said to lie in a plane."""
NEARLY_FLAT = 0.05
"""Depth over width below which a path is drawn in a plane."""
AZIMUTH, ELEVATION = -60.0, 22.0
"""Where the eye of a slant view stands [deg]."""


class View(NamedTuple):
    """A parallel projection.

    Attributes:
        rows: What a point is multiplied with, shape (2, 3), or (3, 3) for 3-D axes.
        names: What the coordinates are called; none in a slant view.
    """

    rows: Array
    names: tuple[str, ...]

    def project(self, points: Array) -> tuple[Array, ...]:
        """Return the coordinates to draw, each of the shape of ``points[..., 0]``."""
        coordinates = points @ self.rows.T
        return tuple(np.moveaxis(coordinates, -1, 0))


def plane(first: int, second: int) -> View:
    """Return the view along a world axis onto the plane of two others."""
    return View(np.eye(3)[[first, second]], ("xyz"[first], "xyz"[second]))


SPACE = View(np.eye(3), ("x", "y", "z"))


def slant() -> View:
    """Return the view from above the front of the scene, z upwards."""
    a, e = radians(AZIMUTH), radians(ELEVATION)
    right = (-sin(a), cos(a), 0.0)
    up = (-sin(e) * cos(a), -sin(e) * sin(a), cos(e))
    return View(np.array([right, up]), ())


def best_plane(points: Array) -> View:
    """Return the view onto the plane of the two axes along which points spread most.

    Args:
        points: Shape (K, 3).
    """
    spread = np.ptp(points, axis=0)
    depth = 2 - int(np.argmin(spread[::-1]))  # the last axis where several spread least
    first, second = (axis for axis in range(3) if axis != depth)
    return plane(first, second)


def is_flat(points: Array, depth: float = FLAT) -> bool:
    """Say whether points lie in a plane across a world axis.

    Args:
        points: Shape (K, 3).
        depth: Their depth over their width that still counts as flat.
    """
    spread = np.ptp(points, axis=0)
    return bool(spread.min() <= depth * spread.max())


def view_for(axes: Axes, points: Array, *, slanted: bool) -> View:
    """Return the view that axes can draw: in space if they are 3-D.

    Args:
        axes: The axes, 2-D or 3-D.
        points: What is to be drawn, shape (K, 3).
        slanted: On 2-D axes, view what does not lie in a plane from a slant.
    """
    if axes.name == "3d":
        return SPACE
    return slant() if slanted and not is_flat(points) else best_plane(points)


def frame_axes(axes: Axes, view: View, points: Array, least: float = 0.0) -> None:
    """Set limits around points, equal scales and labels.

    Args:
        axes: The axes.
        view: The view.
        points: What is to be seen, shape (K, 3).
        least: Width that is shown at least [m], so as not to magnify rounding.
    """
    setters = [axes.set_xlim, axes.set_ylim]
    labels = [axes.set_xlabel, axes.set_ylabel]
    if axes.name == "3d":
        setters.append(axes.set_zlim)  # type: ignore[attr-defined]
        labels.append(axes.set_zlabel)  # type: ignore[attr-defined]
    seen = view.project(points)
    widest = max(float(np.ptp(coordinate)) for coordinate in seen)
    margin = 0.06 * max(widest, least, 1e-6)
    for set_limits, coordinate in zip(setters, seen, strict=True):
        middle = 0.5 * float(coordinate.min() + coordinate.max())
        half = 0.5 * max(float(np.ptp(coordinate)), least) + margin
        set_limits(middle - half, middle + half)
    axes.set_aspect("equal")
    for label, name in zip(labels, view.names, strict=False):
        label(f"{name} [m]")
