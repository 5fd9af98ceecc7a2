"""Things to see, as three.js reads them: solids, tubes, lines and lights."""

from collections.abc import Sequence
from itertools import count
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.visualization.viewer.commands import Json, typed_array

_serial = count(1)

# three.js turns its solids about y, a URDF and we about z.
_Y_TO_Z = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])


def box(size: Sequence[float]) -> Json:
    """Return a box of these lengths [m] about the origin."""
    width, height, depth = map(float, size)
    return _geometry("BoxGeometry", width=width, height=height, depth=depth)


def sphere(radius: float) -> Json:
    """Return a ball [m] about the origin."""
    return _geometry(
        "SphereGeometry", radius=radius, widthSegments=40, heightSegments=24
    )


def cylinder(radius: float, length: float) -> Json:
    """Return a cylinder [m] about z, its middle at the origin."""
    return _geometry(
        "CylinderGeometry",
        radiusTop=radius,
        radiusBottom=radius,
        height=length,
        radialSegments=48,
    )


def capsule(length: float, start_radius: float, end_radius: float) -> Json:
    """Return a capsule [m] along z, from a ball at 0 to one at ``length``."""
    quarter = np.linspace(0.0, np.pi / 2.0, 9)
    below = np.column_stack([np.sin(quarter), -np.cos(quarter)]) * start_radius
    above = np.column_stack([np.cos(quarter), np.sin(quarter)]) * end_radius
    return turned(np.vstack([below, above + np.array([0.0, length])]))


def rounded_cylinder(radius: float, length: float, rounding: float) -> Json:
    """Return a cylinder [m] about z with rounded rims, its middle at the origin."""
    quarter = np.linspace(0.0, np.pi / 2.0, 5)
    rim = np.column_stack([np.cos(quarter), np.sin(quarter)]) * rounding
    upper = rim + np.array([radius - rounding, length / 2.0 - rounding])
    lower = upper[::-1] * [1.0, -1.0]
    axis = [0.0, length / 2.0]
    return turned(np.vstack([[0.0, -axis[1]], lower, upper, axis]))


def arrow(length: float, radius: float) -> Json:
    """Return an arrow [m] along z from the origin."""
    neck = length - 5.0 * radius
    profile = [(0, 0), (1, 0), (1, neck), (2.4, neck), (0, length)]
    return turned(np.array(profile) * [radius, 1.0])


def turned(profile: Array) -> Json:
    """Return the solid that a profile of (radius, z) [m], from below, makes about z."""
    points = [{"x": float(max(r, 0.0)), "y": float(z)} for r, z in profile]
    return _geometry("LatheGeometry", points=points, segments=48)


def plane(size: float) -> Json:
    """Return a square [m] in x and y."""
    return _geometry("PlaneGeometry", width=size, height=size)


def mesh(
    geometry: Json, surface: Json, pose: Array | None = None, *, shadow: bool = True
) -> Json:
    """Return a solid with a surface, at a pose (4, 4) in its node."""
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


def group(things: Sequence[Json]) -> Json:
    """Return several things as one; each keeps its own shadow."""
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


def buffer(
    attributes: dict[str, Array], triangles: Indices | None = None, segment: int = 0
) -> Json:
    """Return a geometry of vertices.

    Args:
        attributes: ``position``, and perhaps ``normal`` and ``color``, a row a vertex.
        triangles: Indices of vertices, three a row; none for lines.
        segment: Indices that one segment of a tube takes, for `set_length`.
    """
    packed = {
        name: {
            "itemSize": rows.shape[1],
            "type": "Float32Array",
            "array": typed_array(rows, np.float32),
            "normalized": False,
        }
        for name, rows in attributes.items()
    }
    data: Json = {"attributes": packed}
    if triangles is not None:
        data["index"] = {
            "itemSize": 1,
            "type": "Uint32Array",
            "array": typed_array(triangles, np.uint32),
            "normalized": False,
        }
    return _geometry("BufferGeometry", data=data, userData={"segment": segment})


def segments(points: Array, colors: Array) -> Json:
    """Return lines of one pixel, a pair of points (2n, 3) [m] each, in RGBA (2n, 4)."""
    geometry = buffer({"position": points, "color": colors})
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


def shadow_catcher(size: float, opacity: float) -> Json:
    """Return a square [m] in x and y that shows nothing but the shadows on it."""
    surface = {
        "uuid": unique_name(),
        "type": "ShadowMaterial",
        "color": 0x000000,
        "transparent": True,
        "opacity": opacity,
        "depthWrite": False,
    }
    thing = mesh(plane(size), surface)
    # On the floor first: lines and shadow lie at one depth, and would take turns.
    thing["object"] |= {"castShadow": False, "renderOrder": -2}
    return thing


def light(kind: str, intensity: float, **properties: Any) -> Json:
    """Return one of three.js's lights."""
    thing = {
        "uuid": unique_name(),
        "type": kind,
        "color": 0xFFFFFF,
        "intensity": intensity,
        **properties,
    }
    return {"object": thing}


def matrix(transform: Array) -> list[float]:
    """Return a homogeneous transform column by column."""
    return [float(number) for number in transform.T.ravel()]


def _geometry(kind: str, **fields: Any) -> Json:
    return {"uuid": unique_name(), "type": kind, **fields}


def unique_name() -> str:
    """Return a name that no other thing of this process has: three.js asks no more."""
    return f"hsp-{next(_serial)}"
