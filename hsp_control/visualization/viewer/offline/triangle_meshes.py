"""Prepares triangle meshes for packing: welds vertices, splits creases, sorts."""

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from hsp_control.common.arrays import Array, Indices

CREASE = np.radians(38.0)
"""Angle between neighbouring triangles from which their edge is a crease [rad]."""


def weld(
    vertices: Array, triangles: Indices, tolerance: float
) -> tuple[Array, Indices]:
    """Merge vertices at the same position; drop triangles that become degenerate."""
    cells = np.rint((vertices - vertices.min(axis=0)) / tolerance).astype(np.int64)
    _, first, cell = np.unique(cells, axis=0, return_index=True, return_inverse=True)
    triangles = cell.reshape(-1)[triangles]
    a, b, c = triangles.T
    return vertices[first], triangles[(a != b) & (b != c) & (c != a)]


def split_creases(vertices: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Duplicate the vertices of creases: normals are smooth across other edges."""
    corners = np.arange(triangles.size).reshape(-1, 3)
    normals = np.cross(
        vertices[triangles[:, 1]] - vertices[triangles[:, 0]],
        vertices[triangles[:, 2]] - vertices[triangles[:, 0]],
    )
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0.0, lengths, 1.0)
    sides = ((0, 1), (1, 2), (2, 0))
    edges = np.concatenate([triangles[:, side] for side in sides])
    ends = np.concatenate([corners[:, side] for side in sides])
    backwards = edges[:, 0] > edges[:, 1]
    edges[backwards], ends[backwards] = edges[backwards, ::-1], ends[backwards, ::-1]
    order = np.lexsort(edges.T)
    edges, ends = edges[order], ends[order]
    shared = np.flatnonzero((edges[1:] == edges[:-1]).all(axis=1))
    here, there = ends[shared], ends[shared + 1]
    cosine = np.sum(normals[here[:, 0] // 3] * normals[there[:, 0] // 3], axis=1)
    smooth = cosine > np.cos(CREASE)
    a, b = here[smooth].ravel(), there[smooth].ravel()
    joined = scipy.sparse.coo_array(
        (np.ones(len(a), bool), (a, b)), shape=(corners.size, corners.size)
    )
    count, group = scipy.sparse.csgraph.connected_components(joined, directed=False)
    split = np.empty((count, 3))
    split[group] = vertices[triangles.ravel()]
    return split, group.astype(np.int64).reshape(-1, 3)


def sort_along_curve(vertices: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Sort triangles along a space-filling curve: neighbours pack well."""
    triangles = triangles[np.argsort(_morton_codes(vertices[triangles].mean(axis=1)))]
    used, first = np.unique(triangles, return_index=True)
    order = np.argsort(first)
    number = np.empty(len(vertices), np.int64)
    number[used[order]] = np.arange(len(used))
    return vertices[used[order]], number[triangles]


def _morton_codes(points: Array) -> Indices:
    """Return each point's Morton (1966) code: its coordinates' bits, interleaved."""
    extent = float(np.ptp(points, axis=0).max()) or 1.0
    cells = ((points - points.min(axis=0)) / extent * 1023.0).astype(np.int64)
    number = np.zeros(len(points), np.int64)
    for bit in range(10):
        for axis in range(3):
            number |= (cells[:, axis] >> bit & 1) << (3 * bit + axis)
    return number
