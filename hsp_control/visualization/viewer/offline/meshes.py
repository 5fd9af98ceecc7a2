"""Reads mesh files as triangles, one piece per colour, as the page reads them."""

import base64
import io
import warnings
from pathlib import PurePath
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import ExportError
from hsp_control.visualization.viewer.commands import Json

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
