"""Reduces the size of a recorded scene: packed meshes, few keyframes, small arrays."""

import base64
import io
import warnings
from collections.abc import Iterable
from pathlib import PurePath
from typing import Any, NamedTuple

import numpy as np
import scipy.sparse
import scipy.sparse.csgraph

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import ExportError
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.packing import ArrayTable, reduce_clip, step_of
from hsp_control.visualization.viewer.threejs import material, matrix, unique_name

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


INSTALL = "pip install 'hsp_control[export]'"


class Piece(NamedTuple):
    """A part of a mesh with one colour."""

    vertices: Array  # (n, 3), in the file's unit of length
    triangles: Indices  # indices of vertices, (k, 3)
    # Red, green, blue and opacity, from 0 to 1; None: the URDF's colour.
    color: tuple[float, ...] | None


def read_mesh(thing: Json, owner: str) -> list[Piece]:
    """Return a mesh file's pieces, one per colour; a texture becomes its mean colour.

    A Collada file's unit and up axis are ignored, as in Meshcat's page and Pinocchio.
    """
    try:
        import collada  # noqa: F401
        import trimesh
    except ImportError as error:
        raise ExportError(
            f"{owner} is drawn from a mesh file, and reading it needs {error.name}: "
            f"{INSTALL}"
        ) from None
    data = thing["data"]
    content = data.encode() if isinstance(data, str) else bytes(data)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about defects of the file
            scene = trimesh.load_scene(
                io.BytesIO(content),
                file_type=thing["format"],
                resolver=_textures(thing.get("resources", {})),
                process=False,
            )
            colored = thing["type"] == "_meshfile_object"
            pieces = [
                _piece(trimesh, scene, node, colored)
                for node in scene.graph.nodes_geometry
                if hasattr(scene.geometry[scene.graph[node][1]], "faces")
            ]
    except Exception as error:  # any error is possible with untrusted files
        raise ExportError(f"{owner}: its mesh cannot be read: {error}") from error
    return merged([piece for piece in pieces if len(piece.triangles)])


def merged(pieces: list[Piece]) -> list[Piece]:
    """Merge the pieces of each colour into one."""
    by_color: dict[tuple[float, ...] | None, list[Piece]] = {}
    for piece in pieces:
        by_color.setdefault(piece.color, []).append(piece)
    result = []
    for color, group in by_color.items():
        before = np.cumsum([0, *(len(piece.vertices) for piece in group)])
        triangles = [p.triangles + n for p, n in zip(group, before[:-1], strict=True)]
        vertices = np.concatenate([piece.vertices for piece in group])
        result.append(Piece(vertices, np.concatenate(triangles), color))
    return result


def _piece(trimesh: Any, scene: Any, node: str, colored: bool) -> Piece:
    pose, name = scene.graph[node]
    mesh = scene.geometry[name]
    vertices = trimesh.transform_points(np.asarray(mesh.vertices, float), pose)
    triangles = np.asarray(mesh.faces, np.int64)
    if np.linalg.det(pose[:3, :3]) < 0.0:  # mirrored: keep the outside outside
        triangles = triangles[:, ::-1]
    return Piece(vertices, triangles, _color(mesh.visual) if colored else None)


def _color(visual: Any) -> tuple[float, ...]:
    """Return a material's colour; of a texture, the mean over the vertices."""
    material = getattr(visual, "material", None)
    if getattr(material, "image", None) or getattr(material, "baseColorTexture", None):
        sampled = visual.to_color().vertex_colors.mean(axis=0)
    elif material is not None:
        sampled = material.main_color
    else:
        sampled = visual.main_color
    return tuple(float(channel) / 255.0 for channel in sampled)


def _textures(addresses: dict[str, str]) -> dict[str, bytes]:
    """Decode a mesh's textures from data URLs; return them by name."""
    textures = {}
    for name, address in addresses.items():
        content = base64.b64decode(address.partition(",")[2])
        textures[name] = textures[PurePath(name).name] = content
    return textures


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
