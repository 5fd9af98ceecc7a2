"""A path in space as a thin tube: a line on the page is never thicker than a pixel."""

import numpy as np

from hsp_control.arrays import Array
from hsp_control.viewer.commands import Json
from hsp_control.viewer.threejs import buffer

_SIDES = 8


def tube(points: Array, radius: float) -> Json:
    """Return a tube along a path.

    Ring i lies about point i, so that a part of the tube is a part of the path.

    Args:
        points: The path [m], shape (N, 3), N ≥ 2.
        radius: Half its thickness [m].
    """
    across, upward = _frames(points)
    angles = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    normals = (
        np.cos(angles)[:, None] * across[:, None, :]
        + np.sin(angles)[:, None] * upward[:, None, :]
    )
    positions = points[:, None, :] + radius * normals
    side = np.arange(_SIDES)
    here, there = side, (side + 1) % _SIDES
    quad = np.stack(
        [here, there, here + _SIDES, there, there + _SIDES, here + _SIDES], axis=1
    )
    rings = _SIDES * np.arange(len(points) - 1)
    return buffer(
        {"position": positions.reshape(-1, 3), "normal": normals.reshape(-1, 3)},
        (rings[:, None, None] + quad).reshape(-1, 3),
        segment=quad.size,
    )


def _frames(points: Array) -> tuple[Array, Array]:
    """Return two unit vectors across the path at each point, that twist little."""
    tangents = np.gradient(points, axis=0)
    lengths = np.linalg.norm(tangents, axis=1)
    moving = lengths > 1e-12 * max(1.0, float(lengths.max()))
    tangents[moving] /= lengths[moving, None]
    last = tangents[moving][0] if moving.any() else np.array([1.0, 0.0, 0.0])
    across = np.empty_like(points)
    normal = np.cross(last, np.eye(3)[np.argmin(np.abs(last))])
    for i, tangent in enumerate(tangents):
        if moving[i]:
            last = tangent
        else:
            tangents[i] = last
        normal = normal - (normal @ last) * last
        size = np.linalg.norm(normal)
        if size < 1e-9:  # the path turned back along the normal
            normal = np.cross(last, np.eye(3)[np.argmin(np.abs(last))])
            size = np.linalg.norm(normal)
        normal = normal / size
        across[i] = normal
    return across, np.cross(tangents, across)
