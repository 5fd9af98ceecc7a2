"""Reduces the size of a recorded scene: packed meshes, few keyframes, small arrays."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.offline.clip_reduction import reduce_clip
from hsp_control.visualization.viewer.offline.meshes import Piece, read_mesh
from hsp_control.visualization.viewer.offline.triangle_meshes import (
    sort_along_curve,
    split_creases,
    weld,
)
from hsp_control.visualization.viewer.packed.packing import ArrayTable, step_of
from hsp_control.visualization.viewer.threejs import material, matrix, unique_name

VERTEX_STEP = 2e-5
"""Resolution of vertices [m], or 2⁻¹⁶ of a mesh's size if that is larger."""
_TRAIL_STEP = 5e-5  # resolution of a trail's points [m]


def reduce_scene(commands: Iterable[Json], arrays: ArrayTable) -> list[Json]:
    """Return commands that show the same scene in fewer bytes."""
    return [_reduced(command, arrays) for command in commands]


def _reduced(command: Json, arrays: ArrayTable) -> Json:
    match command["type"]:
        case "clip":
            return reduce_clip(command, arrays)
        case "trail":
            points = np.reshape(command["points"], (-1, 3))
            return {**command, "points": arrays.numbers(points, _TRAIL_STEP)}
        case "set_object":
            thing = _without_files(command["object"], command["path"], arrays)
            return {**command, "object": _packed(thing, arrays)}
    packed: Json = _packed(command, arrays)
    return packed


def _packed(value: Any, arrays: ArrayTable) -> Any:
    """Return data with its arrays moved to the table."""
    if isinstance(value, dict):
        return {key: _packed(item, arrays) for key, item in value.items()}
    if isinstance(value, list):
        return [_packed(item, arrays) for item in value]
    if isinstance(value, np.ndarray):
        if value.dtype.kind == "f":
            return arrays.numbers(value, step_of(value[:, None], 16), value.dtype)
        return arrays.whole(value)
    return value


class _MeshFileReplacer:
    """Replaces the mesh files of one object by triangles."""

    def __init__(self, thing: Json, owner: str, arrays: ArrayTable) -> None:
        self._owner, self._arrays = owner, arrays
        self._files = {
            geometry["uuid"]: geometry
            for geometry in thing.get("geometries", [])
            if geometry["type"] == "_meshfile_geometry"
        }
        self.geometries = [
            geometry
            for geometry in thing.get("geometries", [])
            if geometry["uuid"] not in self._files
        ]
        self.materials = list(thing.get("materials", []))

    def replaced(self, node: Json, scale: float) -> Json:
        """Return a node of the object without mesh files."""
        if "matrix" in node:
            axes = np.reshape(node["matrix"], (4, 4))[:3, :3]
            scale *= float(np.linalg.norm(axes, axis=1).max())
        if node["type"] == "_meshfile_object":
            children = [
                self._mesh(piece, scale, self._surface(piece), {})
                for piece in read_mesh(node, self._owner)
            ]
            shadows = {k: v for k, v in node.items() if k.endswith("Shadow")}
            for child in children:
                child |= shadows
            return {
                "uuid": node["uuid"],
                "type": "Group",
                "matrix": node.get("matrix", matrix(np.eye(4))),
                "children": children,
            }
        file = self._files.get(node.get("geometry"))
        if file is not None:
            (piece,) = read_mesh(file, self._owner) or [_empty_piece()]
            return self._mesh(piece, scale, node["material"], node)
        if "children" in node:
            children = [self.replaced(child, scale) for child in node["children"]]
            return {**node, "children": children}
        return node

    def _surface(self, piece: Piece) -> str:
        color = piece.color or (0.72, 0.74, 0.76, 1.0)
        surface = material(color, opacity=color[3])
        self.materials.append(surface)
        return str(surface["uuid"])

    def _mesh(self, piece: Piece, scale: float, surface: str, node: Json) -> Json:
        geometry = _geometry(piece, scale, self._arrays)
        self.geometries.append(geometry)
        return {
            **node,
            "uuid": unique_name(),
            "type": "Mesh",
            "geometry": geometry["uuid"],
            "material": surface,
        }


def _without_files(thing: Json, owner: str, arrays: ArrayTable) -> Json:
    files = _MeshFileReplacer(thing, owner, arrays)
    node = files.replaced(thing["object"], 1.0)
    return {
        **thing,
        "geometries": files.geometries,
        "materials": files.materials,
        "object": node,
    }


def _geometry(piece: Piece, scale: float, arrays: ArrayTable) -> Json:
    """Return a piece as a packed geometry; the page computes its normals."""
    size = float(np.ptp(piece.vertices, axis=0).max(initial=0.0)) or 1.0
    vertices, triangles = weld(piece.vertices, piece.triangles, 1e-6 * size)
    vertices, triangles = sort_along_curve(*split_creases(vertices, triangles))
    step = max(VERTEX_STEP / scale, size * 2.0**-16)
    return {
        "uuid": unique_name(),
        "type": "BufferGeometry",
        "data": {
            "attributes": {
                "position": {
                    "itemSize": 3,
                    "type": "Float32Array",
                    "array": arrays.numbers(vertices, step),
                    "normalized": False,
                }
            },
            "index": {
                "itemSize": 1,
                "type": "Uint32Array",
                "array": arrays.triangles(triangles),
                "normalized": False,
            },
        },
    }


def _empty_piece() -> Piece:
    corner: Array = np.zeros((3, 3))
    return Piece(corner, np.array([[0, 1, 2]]), None)
