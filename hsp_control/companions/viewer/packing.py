"""Packs a recorded scene, its meshes, its clip and curves into few bytes."""

import base64
import hashlib
import io
import warnings
from collections.abc import Iterable
from pathlib import PurePath
from typing import Any, NamedTuple

import numpy as np
import umsgpack  # type: ignore[import-untyped]
from numpy.typing import ArrayLike, NDArray

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import ExportError
from hsp_control.companions.viewer.commands import Json, typed_array
from hsp_control.companions.viewer.mesh_files import with_files
from hsp_control.companions.viewer.threejs import material, matrix, unique_name

CLOCK_STEP = 1e-6  # resolution of times [s]
_KINDS = {
    np.dtype("f4"): "Float32Array",
    np.dtype("f8"): "Float64Array",
    np.dtype("u1"): "Uint8Array",
    np.dtype("u4"): "Uint32Array",
}
"""Names of the types in JavaScript."""
_MAX_STEPS = 2**31


class ArrayTable:
    """The arrays of a page; equal arrays are stored once."""

    def __init__(self) -> None:
        """Start without arrays."""
        self.entries: list[Json] = []
        self._numbers: dict[bytes, int] = {}

    def numbers(self, values: ArrayLike, step: float, dtype: Any = np.float32) -> Json:
        """Store numbers to within half a step; return a reference to the array."""
        rows = np.asarray(values, float)
        rows = rows[:, None] if rows.ndim == 1 else rows
        offset = rows.min(axis=0) if len(rows) else np.zeros(rows.shape[1])
        spread = np.ptp(rows, axis=0) if len(rows) else np.zeros(rows.shape[1])
        steps = np.maximum(step, spread / (_MAX_STEPS - 1))
        return self._store(
            np.rint((rows - offset) / steps).astype(np.int64),
            kind=_KINDS[np.dtype(dtype)],
            offset=offset.tolist(),
            step=steps.tolist(),
        )

    def whole(self, values: NDArray[np.integer[Any]]) -> Json:
        """Store integers of shape (n,) exactly; return a reference to the array."""
        return self._store(
            values.astype(np.int64)[:, None],
            kind=_KINDS[values.dtype],
            offset=[0.0],
            step=[1.0],
        )

    def _store(self, whole: Indices, **about: Any) -> Json:
        differences = np.diff(whole, axis=0, prepend=0)
        zigzag = (differences << 1) ^ (differences >> 63)
        largest = int(zigzag.max(initial=0))
        width = next(n for n in range(1, 9) if largest < 256**n)
        columns = np.ascontiguousarray(zigzag.T, "<u8")
        planes = columns.view(np.uint8).reshape(*columns.shape, 8)[..., :width]
        data = np.ascontiguousarray(np.moveaxis(planes, -1, 0)).tobytes()
        rows, count = whole.shape
        head = repr((rows, count, width, sorted(about.items()))).encode()
        key = hashlib.sha256(head + data).digest()
        if key not in self._numbers:
            self._numbers[key] = len(self.entries)
            packed = typed_array(np.frombuffer(data, np.uint8), np.uint8)
            self.entries.append(
                {
                    "rows": rows,
                    "columns": count,
                    "width": width,
                    "bytes": packed,
                    **about,
                }
            )
        return {"$array": self._numbers[key]}


def step_of(values: Array, bits: int) -> float:
    """Return the step that divides the widest column into 2**bits values."""
    spread = float(np.ptp(values, axis=0).max()) if values.size else 0.0
    return spread / (2**bits - 1) or 1.0


def keyframe_rows(
    times: Array, samples: Array, rounded: Array, bound: float
) -> Indices:
    """Return the rows of a curve's keyframes (Douglas and Peucker 1973).

    All segments whose worst sample is off by more than the bound are split there, at
    once. All shapes (n,).
    """
    rows = np.arange(len(times))
    keys = np.unique([0, len(times) - 1])
    while len(keys) < len(times):
        segment = np.clip(np.searchsorted(keys, rows, side="right") - 1, 0, None)
        errors = np.abs(samples - np.interp(times, times[keys], rounded[keys]))
        errors[keys] = 0.0  # at a keyframe, only the rounding error is left
        worst = np.maximum.reduceat(errors, keys)
        first = np.flatnonzero((errors == worst[segment]) & (errors > bound))
        if not len(first):
            break
        _, first_of_each = np.unique(segment[first], return_index=True)
        keys = np.union1d(keys, first[first_of_each])
    return keys


_STEPS = {
    "position": 2.5e-5,
    "quaternion": 2.0**-15,
    "scale": 2.5e-5,
    "color": 1 / 1024,
    "visible": 1.0,
    "length": 1 / 64,
}
"""Resolutions of the properties that a track animates."""


def reduce_clip(command: Json, arrays: ArrayTable) -> Json:
    """Return a clip's command in few bytes; constant values have one row."""
    clocks: list[Json] = []
    tracks = []
    for track in command["tracks"]:
        times = np.asarray(command["clocks"][track["clock"]], float)
        values = np.asarray(track["values"], float).reshape(len(times), -1)
        step = _STEPS[track["property"]]
        if len(times) and np.ptp(values, axis=0).max() < 0.5 * step:
            times, values = times[:1], values[:1]
        clock = arrays.numbers(times, CLOCK_STEP, np.float64)
        if clock not in clocks:
            clocks.append(clock)
        packed = arrays.numbers(values, step)
        tracks.append({**track, "clock": clocks.index(clock), "values": packed})
    return {**command, "clocks": clocks, "tracks": tracks}


CREASE = np.radians(38.0)
"""Angle between neighbouring triangles from which their edge is a crease [rad]."""


def sort_along_curve(vertices: Array, triangles: Indices) -> tuple[Array, Indices]:
    """Sort triangles along a space-filling curve: neighbours pack well."""
    triangles = triangles[np.argsort(_morton_codes(vertices[triangles].mean(axis=1)))]
    used, first = np.unique(triangles, return_index=True)
    order = np.argsort(first)
    number = np.empty(len(vertices), np.int64)
    number[used[order]] = np.arange(len(used))
    return vertices[used[order]], number[triangles]


def _morton_codes(points: Array) -> Indices:
    """Return the points' Morton (1966) codes: their coordinates' bits, interleaved."""
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

    A Collada file's unit and up axis are in the object's matrix: vertices stay as they
    are in the file, as in Meshcat's page.
    """
    try:
        import collada  # noqa: F401
        import trimesh
    except ImportError as error:
        raise ExportError(
            f"{owner} is drawn from a mesh file, and reading it needs {error.name}: "
            f"{INSTALL}"
        ) from None
    content = _content(thing)
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


def _content(thing: Json) -> bytes:
    data = thing["data"]
    if isinstance(data, umsgpack.Ext):  # in the form in which pages receive it
        data = data.data
    return data.encode() if isinstance(data, str) else bytes(data)


_KEPT = 256  # mesh files: those of some robots
_smooth: dict[bytes, list[Piece]] = {}


def smooth_mesh(thing: Json, owner: str) -> list[Piece]:
    """Return `read_mesh`, with vertices merged, doubled at creases and sorted; cached.

    Runs that are compared show the same robot, and so do most pages of a process.
    """
    about = [thing["format"], thing["type"], thing.get("resources", {})]
    key = hashlib.sha256(repr(about).encode() + _content(thing)).digest()
    if key not in _smooth:
        pieces = [_smoothed(piece) for piece in read_mesh(thing, owner)]
        while len(_smooth) >= _KEPT:
            del _smooth[next(iter(_smooth))]  # the oldest
        _smooth[key] = pieces
    return _smooth[key]


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
    return [_reduced(command, arrays) for command in with_files(commands)]


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


def _without_files(thing: Json, owner: str, arrays: ArrayTable) -> Json:
    """Return an object with triangles in place of its mesh files."""
    known = thing.get("geometries", [])
    files = {g["uuid"]: g for g in known if g["type"] == "_meshfile_geometry"}
    geometries = [each for each in known if each["uuid"] not in files]
    materials = list(thing.get("materials", []))

    def mesh(piece: Piece, scale: float, surface: str, shadows: Json) -> Json:
        geometry = _geometry(piece, scale, arrays)
        geometries.append(geometry)
        about = {"geometry": geometry["uuid"], "material": surface}
        return {"uuid": unique_name(), "type": "Mesh", **about, **shadows}

    def replaced(node: Json, scale: float) -> Json:
        if "matrix" in node:
            axes = np.reshape(node["matrix"], (4, 4))[:3, :3]
            scale *= float(np.linalg.norm(axes, axis=1).max())
        shadows = {k: v for k, v in node.items() if k.endswith("Shadow")}
        if node["type"] == "_meshfile_object":
            children = []
            for piece in smooth_mesh(node, owner):
                color = piece.color or (0.72, 0.74, 0.76, 1.0)
                surface = material(color, opacity=color[3])
                materials.append(surface)
                children.append(mesh(piece, scale, surface["uuid"], shadows))
        elif file := files.get(node.get("geometry")):
            pieces = smooth_mesh(file, owner)
            children = [mesh(p, scale, node["material"], shadows) for p in pieces]
        elif "children" in node:
            children = [replaced(child, scale) for child in node["children"]]
            return {**node, "children": children}
        else:
            return node
        place = node.get("matrix", matrix(np.eye(4)))
        group = {"uuid": node["uuid"], "type": "Group", "matrix": place}
        return {**group, "children": children}

    drawn = replaced(thing["object"], 1.0)
    about = {"geometries": geometries, "materials": materials}
    return {**thing, **about, "object": drawn}


def _smoothed(piece: Piece) -> Piece:
    """Return a piece whose normals the page can compute."""
    import trimesh
    from trimesh.graph import smooth_shade

    solid = trimesh.Trimesh(piece.vertices, piece.triangles)  # with vertices merged
    solid.update_faces(solid.nondegenerate_faces())
    # The vertices of creases are doubled: normals are smooth across other edges.
    solid = smooth_shade(solid, angle=CREASE, facet_minarea=None)
    return Piece(*sort_along_curve(solid.vertices, solid.faces), piece.color)


def _geometry(piece: Piece, scale: float, arrays: ArrayTable) -> Json:
    """Return a smooth piece as a packed geometry; the page computes its normals."""
    vertices, triangles, _ = piece
    size = float(np.ptp(vertices, axis=0).max(initial=0.0)) or 1.0
    step = max(VERTEX_STEP / float(f"{scale:.6g}"), size * 2.0**-16)
    places = arrays.numbers(vertices, step)
    corners = arrays.whole(triangles.astype(np.uint32).ravel())
    position = {"itemSize": 3, "type": "Float32Array", "array": places}
    index = {"itemSize": 1, "type": "Uint32Array", "array": corners}
    data = {"attributes": {"position": position}, "index": index}
    # Equal meshes have equal names: the page keeps one geometry for all of them.
    name = f"mesh {places['$array']} {corners['$array']}"
    about = {"uuid": unique_name(), "type": "BufferGeometry", "name": name}
    return {**about, "data": data}
