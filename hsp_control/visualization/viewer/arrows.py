"""Arrows and bars: drawn once with length 1, then turned and scaled."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.poses import quaternions_along

_FULL = 12.0
"""From this length on, over its radius, an arrow is as thick as it will be."""


def unit_arrow(surface: Json, radius: float) -> Json:
    """Return an arrow along z of length 1, its shaft of a radius [m]."""
    profile = np.array([(0, 0), (1, 0), (1, 0.72), (2.5, 0.72), (0, 1)])
    thing = threejs.mesh(threejs.turned(profile * [radius, 1.0]), surface, shadow=False)
    thing["object"]["renderOrder"] = 1  # after what it shines through
    return threejs.group([thing])


def unit_bar(surface: Json, radius: float) -> Json:
    """Return a bar along z of length 1 and a radius [m]."""
    solid = threejs.turned(np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * [radius, 1.0])
    return threejs.group([threejs.mesh(solid, surface, shadow=False)])


def arrow_tracks(
    path: str, times: Array, origins: Array, vectors: Array, radius: float
) -> Iterator[Track]:
    """Yield how a unit arrow becomes arrows; short ones are thin.

    Args:
        path: Its node.
        times: When [s], shape (N,).
        origins: Where they begin [m], shape (N, 3).
        vectors: From there to where they end [m], shape (N, 3); of length 0: none.
        radius: Of the unit arrow's shaft [m].
    """
    lengths = np.linalg.norm(vectors, axis=1)
    widths = np.minimum(lengths / (_FULL * radius), 1.0)
    yield from _tracks(path, times, origins, vectors, np.c_[widths, widths, lengths])


def bar_tracks(
    path: str, times: Array, starts: Array, ends: Array, shown: Array
) -> Iterator[Track]:
    """Yield how a unit bar joins two points.

    Args:
        path: Its node.
        times: When [s], shape (N,).
        starts: From where [m], shape (N, 3).
        ends: To where [m], shape (N, 3).
        shown: Whether it is to be seen, shape (N,).
    """
    vectors = ends - starts
    ones = np.ones(len(times))
    scales = np.c_[ones, ones, np.linalg.norm(vectors, axis=1)]
    yield from _tracks(path, times, starts, vectors, scales)
    yield Track(path, "visible", times, np.asarray(shown, float)[:, None])


def _tracks(
    path: str, times: Array, origins: Array, vectors: Array, scales: Array
) -> Iterator[Track]:
    yield Track(path, "position", times, origins)
    yield Track(path, "quaternion", times, quaternions_along(vectors))
    yield Track(path, "scale", times, scales)
