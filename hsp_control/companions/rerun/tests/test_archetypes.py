"""Rerun draws every type of shape at its pose."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mesh_texts import CORNERS, SIDES, tetrahedron
from robot_texts import INERTIA, joint, link, robot_xml

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.companions.rerun.log import _archetypes, _normals, _shape
from hsp_control.companions.viewer.robot_drawing import Visual, read_visuals


@dataclass
class Drawn:
    """A Rerun archetype with its arguments."""

    kind: str
    given: dict[str, Any]


class Rerun:
    """Records drawn objects, without Rerun."""

    def __getattr__(self, kind: str) -> Any:
        return lambda **given: Drawn(kind, given)


def extent(drawn: Drawn) -> Array:
    """Return the bounding box of an archetype, (2, 3) [m].

    By Rerun's documentation a capsule's axis begins at its origin along z, without its
    caps; all others are centred.
    """
    given = drawn.given
    low, high = np.zeros((2, 3))
    match drawn.kind:
        case "Boxes3D":
            high = 0.5 * np.array(given["sizes"][0], dtype=float)
            low = -high
        case "Ellipsoids3D":
            high = np.ones(3) * given["radii"][0]
            low = -high
        case "Cylinders3D" | "Capsules3D":
            radius, length = given["radii"][0], given["lengths"][0]
            half = 0.5 * length
            low, high = np.array([[-radius] * 3, [radius] * 3])
            if drawn.kind == "Cylinders3D":
                low[2], high[2] = -half, half
            else:
                high[2] += length
        case _:
            points = np.array(given["vertex_positions"])
            low, high = points.min(axis=0), points.max(axis=0)
    shift = np.array(given.get("translations", [[0.0, 0.0, 0.0]])[0])
    return np.array([low + shift, high + shift])


BOUNDS = {
    "box": ((0.2, 0.4, 0.6), (0.1, 0.2, 0.3)),
    "sphere": ((0.3,), (0.3, 0.3, 0.3)),
    "cylinder": ((0.1, 0.8), (0.1, 0.1, 0.4)),
    "capsule": ((0.1, 0.8), (0.1, 0.1, 0.5)),
    "ellipsoid": ((0.1, 0.2, 0.3), (0.1, 0.2, 0.3)),
}
"""Sizes by type, and half extents along the axes [m]."""


@pytest.mark.parametrize("kind", BOUNDS)
def test_a_links_shape_is_about_its_place(kind: str) -> None:
    size, half = BOUNDS[kind]
    color = (0.1, 0.2, 0.3, 1.0)
    visual = Visual(1, "link", np.eye(4), kind, size, color, None)
    (drawn,) = _archetypes(Rerun(), visual, "link")
    np.testing.assert_allclose(extent(drawn), [np.negative(half), half])
    assert drawn.given["colors"] == [[*color]]


@pytest.mark.parametrize(("shape", "half"), [
    (hsp.shapes.Box([0.2, 0.4, 0.6]), (0.1, 0.2, 0.3)),
    (hsp.shapes.Sphere(0.3), (0.3, 0.3, 0.3)),
    (hsp.shapes.Cylinder(0.1, 0.8), (0.1, 0.1, 0.4)),
    (hsp.shapes.Capsule(0.1, 0.8), (0.1, 0.1, 0.5)),
])  # fmt: skip
def test_an_obstacle_is_about_its_centre(shape: Any, half: tuple[float, ...]) -> None:
    (drawn,) = _shape(Rerun(), shape)
    np.testing.assert_allclose(extent(drawn), [np.negative(half), half])


def test_the_normals_of_a_solid_point_outwards() -> None:
    """Otherwise its inner side is lit."""
    corners = np.array(
        [[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1], [0, 0, -1]]
    )
    triangles = np.array(
        [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4],
         [2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]]
    )  # fmt: skip
    normals = _normals(corners, triangles)
    np.testing.assert_allclose(normals, corners, atol=1e-12)


@pytest.mark.parametrize("ending", ["stl", "obj", "dae", "ply", "off", "gltf"])
def test_a_links_mesh_is_drawn_of_any_format(ending: str, tmp_path: Path) -> None:
    file = tmp_path / f"mesh.{ending}"
    if ending == "stl":
        faces = CORNERS[np.array(SIDES)].astype("<f4").reshape(4, 9)
        rows = [np.zeros(3, "<f4").tobytes() + f.tobytes() + b"\0\0" for f in faces]
        file.write_bytes(bytes(80) + (4).to_bytes(4, "little") + b"".join(rows))
    else:
        tetrahedron(file)
    urdf = tmp_path / "arm.urdf"
    scaled = f'<mesh filename="{file}" scale="2 0.5 1"/>'
    mesh = f"<geometry>{scaled}</geometry>"
    shape = f"<visual>{mesh}</visual>"
    urdf.write_text(
        robot_xml(link("a"), link("b", INERTIA + shape), joint("j", "a", "b"))
    )
    (visual,) = read_visuals(hsp.Robot.load(urdf))
    (drawn,) = _archetypes(Rerun(), visual, "link")
    np.testing.assert_allclose(extent(drawn), [np.zeros(3), [2.0, 1.0, 3.0]])
