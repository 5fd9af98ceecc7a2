"""Objects, mesh files, materials and poses of three.js, in Meshcat's format."""

import base64
import mimetypes
from collections.abc import Sequence
from itertools import count
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, Indices
from hsp_control.companions.viewer.commands import Json, typed_array
from hsp_control.robot.description.mesh_files import PICTURES


def pose_at(position: ArrayLike) -> Array:
    """Return the pose with a position [m] and no rotation, shape (4, 4)."""
    pose = np.eye(4)
    pose[:3, 3] = position
    return pose


def pose_along(direction: Array) -> Array:
    """Return the smallest rotation of z to a direction, as a pose of shape (4, 4)."""
    z = np.array([0.0, 0.0, 1.0])
    turn = pin.Quaternion.FromTwoVectors(z, direction / np.linalg.norm(direction))
    pose = np.eye(4)
    pose[:3, :3] = turn.toRotationMatrix()
    return pose


def quaternions_along(directions: Array) -> Array:
    """Return the smallest rotations of z to directions, quaternions, shape (N, 4)."""
    lengths = np.linalg.norm(directions, axis=1, keepdims=True)
    x, y, z = (directions / np.where(lengths > 0.0, lengths, 1.0)).T
    turns = np.column_stack([-y, x, np.zeros_like(x), 1.0 + z])
    sizes = np.linalg.norm(turns, axis=1, keepdims=True)
    straight_down = np.array([1.0, 0.0, 0.0, 0.0])
    return np.where(sizes > 1e-9, turns / np.maximum(sizes, 1e-9), straight_down)


_serial = count(1)

# The axis of three.js's solids is y; ours, and a URDF's, is z.
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])


def box(size: Sequence[float]) -> Json:
    """Return a box with the given edges [m], centred at the origin."""
    width, height, depth = map(float, size)
    return _geometry("BoxGeometry", width=width, height=height, depth=depth)


def sphere(radius: float) -> Json:
    """Return a ball of a radius [m], centred at the origin."""
    return _geometry(
        "SphereGeometry", radius=radius, widthSegments=40, heightSegments=24
    )


def cylinder(radius: float, length: float) -> Json:
    """Return a cylinder along z, centred at the origin; lengths in m."""
    return _geometry(
        "CylinderGeometry",
        radiusTop=radius,
        radiusBottom=radius,
        height=length,
        radialSegments=48,
    )


def capsule(length: float, start_radius: float, end_radius: float) -> Json:
    """Return a capsule along z, from a ball at 0 to one at ``length``; in m."""
    quarter = np.linspace(0.0, np.pi / 2.0, 9)
    below = np.column_stack([np.sin(quarter), -np.cos(quarter)]) * start_radius
    above = np.column_stack([np.cos(quarter), np.sin(quarter)]) * end_radius
    return lathe(np.vstack([below, above + np.array([0.0, length])]))


def rounded_cylinder(radius: float, length: float, rounding: float) -> Json:
    """Return a cylinder along z with rounded rims, centred at the origin; in m."""
    quarter = np.linspace(0.0, np.pi / 2.0, 5)
    rim = np.column_stack([np.cos(quarter), np.sin(quarter)]) * rounding
    upper = rim + np.array([radius - rounding, length / 2.0 - rounding])
    lower = upper[::-1] * [1.0, -1.0]
    axis = [0.0, length / 2.0]
    return lathe(np.vstack([[0.0, -axis[1]], lower, upper, axis]))


def arrow(length: float, radius: float) -> Json:
    """Return an arrow along z from the origin; lengths in m."""
    neck = length - 5.0 * radius
    profile = [(0, 0), (1, 0), (1, neck), (2.4, neck), (0, length)]
    return lathe(np.array(profile) * [radius, 1.0])


def lathe(profile: Array) -> Json:
    """Return the solid of revolution about z of a profile."""
    points = [{"x": float(max(r, 0.0)), "y": float(z)} for r, z in profile]
    return _geometry("LatheGeometry", points=points, segments=48)


def plane(size: float) -> Json:
    """Return a square in the x-y plane with an edge [m]."""
    return _geometry("PlaneGeometry", width=size, height=size)


def mesh(
    geometry: Json, surface: Json, pose: Array | None = None, *, shadow: bool = True
) -> Json:
    """Return an object of a geometry and a material."""
    total = np.eye(4) if pose is None else pose
    if geometry["type"] in {"CylinderGeometry", "LatheGeometry"}:
        total = total @ _Y_TO_Z
    return {
        "geometries": [geometry],
        "materials": [surface],
        "object": {
            "uuid": unique_name(),
            "type": "Mesh",
            "geometry": geometry["uuid"],
            "material": surface["uuid"],
            "matrix": matrix(total),
            "castShadow": shadow,
            "receiveShadow": shadow,
        },
    }


def mesh_group(geometry: Json, surface: Json, *about: Any, shadow: bool = True) -> Json:
    """Return a separate object of a geometry and a material; see `mesh`."""
    return group([mesh(geometry, surface, *about, shadow=shadow)])


def group(things: Sequence[Json]) -> Json:
    """Return several objects as one; they keep their shadow settings."""
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [g for thing in things for g in thing.get("geometries", [])],
        "materials": [m for thing in things for m in thing.get("materials", [])],
        "object": {
            "uuid": unique_name(),
            "type": "Group",
            "children": [thing["object"] for thing in things],
        },
    }


def buffer_geometry(attributes: dict[str, Array]) -> Json:
    """Return a geometry of explicit vertices."""
    packed = {
        name: {
            "itemSize": rows.shape[1],
            "type": "Float32Array",
            "array": typed_array(rows, np.float32),
            "normalized": False,
        }
        for name, rows in attributes.items()
    }
    return _geometry("BufferGeometry", data={"attributes": packed})


def facets(vertices: Array, triangles: Indices) -> Json:
    """Return flat-shaded triangles, with separate vertices and normals."""
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1, keepdims=True)
    normals /= np.where(lengths > 0.0, lengths, 1.0)
    return buffer_geometry(
        {"position": corners.reshape(-1, 3), "normal": np.repeat(normals, 3, axis=0)}
    )


def segments(points: Array, colors: Array) -> Json:
    """Return line segments of one pixel width; points (2n, 3) [m], colors (2n, 4)."""
    geometry = buffer_geometry({"position": points, "color": colors})
    surface = {
        "uuid": unique_name(),
        "type": "LineBasicMaterial",
        "vertexColors": True,
        "transparent": True,
        "depthWrite": False,
    }
    thing = mesh(geometry, surface, shadow=False)
    thing["object"] |= {"type": "LineSegments", "renderOrder": -1}
    return thing


def painted(points: Array, colors: Array) -> Json:
    """Return unlit triangles; points (3n, 3) [m], colors with opacity (3n, 4)."""
    surface = unlit_material("#FFFFFF") | {
        "vertexColors": True,
        "transparent": True,
        "depthWrite": False,
    }
    geometry = buffer_geometry({"position": points, "color": colors})
    thing = mesh(geometry, surface, shadow=False)
    thing["object"] |= {"renderOrder": -3}  # below the shadow and the grid
    return thing


def shadow_catcher(size: float, opacity: float) -> Json:
    """Return a square in the x-y plane that shows only the shadows on it."""
    surface = {
        "uuid": unique_name(),
        "type": "ShadowMaterial",
        "color": 0x000000,
        "transparent": True,
        "opacity": opacity,
        "depthWrite": False,
    }
    thing = mesh(plane(size), surface)
    # Drawn first: the grid and the shadow have the same depth and would flicker.
    thing["object"] |= {"castShadow": False, "renderOrder": -2}
    return thing


def light(kind: str, intensity: float, **properties: Any) -> Json:
    """Return a light; ``kind`` is the name of three.js's class."""
    thing = {
        "uuid": unique_name(),
        "type": kind,
        "color": 0xFFFFFF,
        "intensity": intensity,
        **properties,
    }
    return {"object": thing}


def matrix(transform: Array) -> list[float]:
    """Return a homogeneous transform, shape (4, 4), as 16 numbers column by column."""
    return [float(number) for number in transform.T.ravel()]


def _geometry(kind: str, **fields: Any) -> Json:
    return {"uuid": unique_name(), "type": kind, **fields}


def unique_name() -> str:
    """Return a name that is unique in this process, which three.js requires."""
    return f"hsp-{next(_serial)}"


def material(
    color: str | Sequence[float], *, opacity: float = 1.0, glow: float = 0.0
) -> Json:
    """Return a material that is lit by the scene's lights."""
    number = color_number(color)
    lit = color_number([(1.0 - glow) * (number >> k & 255) / 255 for k in (16, 8, 0)])
    surface: Json = {
        "uuid": unique_name(),
        "type": "MeshStandardMaterial",
        "color": lit,
        "roughness": 0.55,
        "metalness": 0.0,
        "emissive": number,
        "emissiveIntensity": glow,
    }
    if opacity < 1.0:
        surface |= {"transparent": True, "opacity": opacity, "depthWrite": False}
    return surface


def always_visible(surface: Json) -> Json:
    """Return a material without depth test, which is visible even inside a link."""
    return surface | {"transparent": True, "depthTest": False, "depthWrite": False}


def unlit_material(color: str) -> Json:
    """Return a material that has the same colour, ``#RRGGBB``, in any light."""
    return {
        "uuid": unique_name(),
        "type": "MeshBasicMaterial",
        "color": color_number(color),
        "side": 0,
    }


def color_number(color: str | Sequence[float]) -> int:
    """Return ``#RRGGBB``, or red, green and blue from 0 to 1, as three.js's number."""
    if isinstance(color, str):
        return int(color[1:], 16)
    red, green, blue = (round(255 * min(max(c, 0.0), 1.0)) for c in color[:3])
    return red << 16 | green << 8 | blue


def mesh_geometry(file: Path) -> Json:
    """Return an OBJ or STL file as a geometry without material."""
    kind = file.suffix.lower()[1:]
    data = (
        typed_array(np.frombuffer(file.read_bytes(), np.uint8), np.uint8)
        if kind == "stl"
        else file.read_text(encoding="utf-8", errors="replace")
    )
    return {
        "uuid": unique_name(),
        "type": "_meshfile_geometry",
        "format": kind,
        "data": data,
    }


def collada_object(file: Path) -> Json:
    """Return a Collada file as an object with its own materials and textures."""
    text = file.read_text(encoding="utf-8", errors="replace")
    return {
        "metadata": {"version": 4.5, "type": "Object"},
        "geometries": [],
        "materials": [],
        "object": {
            "uuid": unique_name(),
            "type": "_meshfile_object",
            "format": "dae",
            "data": text,
            "resources": _textures(file, text),
        },
    }


def _textures(file: Path, text: str) -> dict[str, str]:
    """Return the images that a Collada file names, as data URLs by name."""
    if "<init_from>" not in text:
        return {}
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError):  # the page reports it
        return {}
    names = {
        (element.text or "").strip()
        for images in root.iter()
        if images.tag.endswith("library_images")
        for element in images.iter()
        if element.tag.endswith("init_from")
    }
    found = {}
    for name in names:
        image = file.parent / name.removeprefix("file://")
        if image.suffix.lower() in PICTURES and image.is_file():
            kind = mimetypes.guess_type(image.name)[0] or "image/png"
            content = base64.b64encode(image.read_bytes()).decode()
            found[name] = f"data:{kind};base64,{content}"
    return found
