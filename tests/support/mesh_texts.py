"""A tetrahedron as a mesh file of any format, unit and up axis."""

import json
from pathlib import Path

import numpy as np

from hsp_control.common.arrays import Array

CORNERS = np.array([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]])
"""Its corners in a link, shape (4, 3) [m]."""
SIDES = [(0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3)]
_FROM_LINK = {  # (right, up, inwards) of Collada's table, in the link's x, z and -y
    "X_UP": lambda x, y, z: (z, -x, -y),
    "Y_UP": lambda x, y, z: (x, z, -y),
    "Z_UP": lambda x, y, z: (x, y, z),
    None: lambda x, y, z: (x, y, z),
}

COLLADA = """<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{asset}</asset>
<library_geometries><geometry id="g"><mesh><source id="p">
<float_array id="pa" count="12">{numbers}</float_array><technique_common>
<accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor>
</technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>{indices}</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n">
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>"""


def tetrahedron(
    file: Path, unit: float | str | None = None, up: str | None = None
) -> Path:
    """Write `CORNERS` to a file in its format; units and axes are Collada's."""
    length = float(unit) if unit is not None else 1.0
    corners = np.array([_FROM_LINK[up](*corner) for corner in CORNERS]) / length
    write = {".dae": _dae, ".gltf": _gltf, ".ply": _ply, ".off": _off, ".obj": _obj}
    if file.suffix == ".gltf":
        corners = np.array([_FROM_LINK["Y_UP"](*corner) for corner in CORNERS])
    if file.suffix == ".dae":
        content = "" if unit is None else f'<unit name="u" meter="{unit}"/>'
        content += "" if up is None else f"<up_axis>{up}</up_axis>"
        file.write_text(_dae(corners).replace("<asset>", f"<asset>{content}"))
    else:
        file.write_text(write[file.suffix](corners))
    return file


def _words(numbers: Array) -> str:
    return " ".join(map(repr, numbers.ravel().tolist()))


def _dae(corners: Array) -> str:
    return COLLADA.format(
        asset="", numbers=_words(corners), indices=_words(np.array(SIDES))
    )


def _off(corners: Array) -> str:
    lines = ["OFF", "4 4 6", *map(_words, corners)]
    return "\n".join([*lines, *(f"3 {a} {b} {c}" for a, b, c in SIDES)]) + "\n"


def _obj(corners: Array) -> str:
    lines = [f"v {_words(corner)}" for corner in corners]
    lines += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in SIDES]
    return "\n".join(lines) + "\n"


def _ply(corners: Array) -> str:
    head = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y"
    head += "\nproperty float z\nelement face 4\nproperty list uchar int vertex_index"
    lines = [head, "end_header", *map(_words, corners)]
    return "\n".join([*lines, *(f"3 {a} {b} {c}" for a, b, c in SIDES)]) + "\n"


def _gltf(corners: Array) -> str:
    import base64

    points = corners.astype("<f4").tobytes()
    indices = np.array(SIDES, "<u2").tobytes()
    data = base64.b64encode(points + indices).decode()
    uri = f"data:application/octet-stream;base64,{data}"
    return json.dumps(
        {
            "asset": {"version": "2.0"},
            "scene": 0,
            "scenes": [{"nodes": [0]}],
            "nodes": [{"mesh": 0}],
            "meshes": [
                {"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}
            ],
            "buffers": [{"byteLength": len(points) + len(indices), "uri": uri}],
            "bufferViews": [
                {"buffer": 0, "byteLength": len(points)},
                {"buffer": 0, "byteOffset": len(points), "byteLength": len(indices)},
            ],
            "accessors": [
                {
                    "bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                    "min": corners.min(axis=0).tolist(),
                    "max": corners.max(axis=0).tolist(),
                },
                {
                    "bufferView": 1, "componentType": 5123, "count": 12,
                    "type": "SCALAR",
                },
            ],
        }
    )  # fmt: skip
