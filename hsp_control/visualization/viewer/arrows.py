"""Arrows and bars: drawn once with length 1, then rotated and scaled."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.poses import quaternions_along

_FULL_WIDTH = 12.0
"""Length over radius from which an arrow has its full radius."""


def unit_arrow(surface: Json, radius: float) -> Json:
    """Return an arrow along z of length 1 with the given shaft radius [m]."""
    profile = np.array([(0, 0), (1, 0), (1, 0.72), (2.5, 0.72), (0, 1)])
    thing = threejs.mesh(threejs.lathe(profile * [radius, 1.0]), surface, shadow=False)
    thing["object"]["renderOrder"] = (
        1  # draw it after the objects that it is seen through
    )
    return threejs.group([thing])


def unit_bar(surface: Json, radius: float) -> Json:
    """Return a bar along z of length 1 with the given radius [m]."""
    solid = threejs.lathe(np.array([(0, 0), (1, 0), (1, 1), (0, 1)]) * [radius, 1.0])
    return threejs.group([threejs.mesh(solid, surface, shadow=False)])


def arrow_tracks(
    path: str, times: Array, origins: Array, vectors: Array, radius: float
) -> Iterator[Track]:
    """Yield the tracks that turn a unit arrow into vectors; short arrows are thinner.

    Shapes: times (N,) [s], origins (N, 3) [m], vectors (N, 3) [m].
    """
    lengths = np.linalg.norm(vectors, axis=1)
    widths = np.minimum(lengths / (_FULL_WIDTH * radius), 1.0)
    yield from _tracks(path, times, origins, vectors, np.c_[widths, widths, lengths])


def bar_tracks(
    path: str, times: Array, starts: Array, ends: Array, shown: Array
) -> Iterator[Track]:
    """Yield the tracks with which a unit bar connects two points.

    Shapes: times (N,) [s], starts (N, 3) [m], ends (N, 3) [m], shown (N,).
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
