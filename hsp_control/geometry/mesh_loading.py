"""Read a mesh file of any format that Assimp supports, in metres and with z up."""

from pathlib import Path
from typing import Any

import coal
import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.robot.description.mesh_units import MeshUnits, mesh_units


def load_mesh(file: Path, scale: Array) -> Any:
    """Return Coal's mesh of a file.

    Args:
        file: The file; its unit and its up axis are applied.
        scale: A factor along each axis of a link, shape (3,) [-].

    Raises:
        RuntimeError: If the file cannot be read.
        ValueError: If it is no mesh, or its unit is none.
    """
    units = mesh_units(file)
    mesh = coal.MeshLoader().load(str(file), units.scale(scale))
    if units.up == MeshUnits().up:
        return mesh
    vertices, triangles = facets(mesh)
    return mesh_of(vertices @ units.turn.T, triangles)


def why_unread(error: Exception) -> str:
    """Return the reason in a longer message of Coal's reader."""
    text = str(error).strip() or type(error).__name__
    lines = text.rpartition("message: ")[2].splitlines()
    return ": ".join(line for line in lines if not line.startswith("Hint: "))


def facets(mesh: Any) -> tuple[Array, Indices]:
    """Return a mesh's vertices, shape (k, 3), and triangles, shape (n, 3)."""
    corners = [mesh.tri_indices(k) for k in range(mesh.num_tris)]
    triangles = np.array([(each[0], each[1], each[2]) for each in corners])
    return np.array(mesh.vertices()), triangles.astype(np.int64).reshape(-1, 3)


def mesh_of(vertices: Array, triangles: Indices) -> Any:
    """Return Coal's mesh of vertices (k, 3) and triangles of their indices (n, 3)."""
    mesh = coal.BVHModelOBBRSS()
    mesh.beginModel(len(triangles), len(vertices))
    for triangle in vertices[triangles]:
        mesh.addTriangle(*triangle)
    mesh.endModel()
    return mesh
