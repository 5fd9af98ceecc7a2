"""A mesh file's unit and up axis are applied; all of Assimp's formats are read."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from mesh_texts import CORNERS, tetrahedron
from odd_robots import collision, odd_robot

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError, SceneError
from hsp_control.geometry import link_shapes
from hsp_control.geometry.shapes import Mesh
from hsp_control.robot.description.mesh_units import mesh_units

SAID = [
    ("mesh.dae", unit, up)
    for unit, up in (
        (None, None), ("1", "Z_UP"), ("0.01", "Z_UP"), ("0.0254", None),
        ("1", "Y_UP"), ("0.001", "Y_UP"), ("0.01", "X_UP"),
    )
]  # fmt: skip
FILES = [*SAID, *((f"mesh.{end}", None, None) for end in ("gltf", "ply", "off", "obj"))]
every_file = pytest.mark.parametrize(("name", "unit", "up"), FILES)


def assert_same_points(found: Array, expected: Array) -> None:
    """Every known format is among Assimp's."""
    away = np.linalg.norm(found[:, None] - expected[None], axis=2)
    assert max(away.min(axis=0).max(), away.min(axis=1).max()) < 1e-6


@every_file
def test_distances_see_a_mesh_in_metres_and_upright(
    name: str, unit: str | None, up: str | None, tmp_path: Path
) -> None:
    """With a scale along the link's axes, and a rotated origin."""
    file = tetrahedron(tmp_path / name, unit, up)
    mesh = f'<mesh filename="{file.name}" scale="0.1 0.2 0.5"/>'
    robot = odd_robot(tmp_path, collision(mesh))
    own = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.2, 1.0), np.array([0.1, 0.02, -0.03]))
    expected = np.array([own.act(corner) for corner in CORNERS * (0.1, 0.2, 0.5)])
    (shape,) = link_shapes(robot, "meshes")
    found = [shape.placement.act(each) for each in shape.geometry.vertices()]
    assert_same_points(np.array(found), expected)


@every_file
def test_an_obstacle_is_in_metres_and_upright(
    name: str, unit: str | None, up: str | None, tmp_path: Path
) -> None:
    """The URDF's scale is a factor on the file's unit."""
    mesh = Mesh(tetrahedron(tmp_path / name, unit, up), scale=0.5)
    assert_same_points(np.array(mesh.geometry().vertices()), 0.5 * CORNERS)
    assert mesh.bounding_radius == pytest.approx(1.5)


@pytest.mark.parametrize(("content", "message"), [
    ('<unit meter="0"/>', '<unit meter="0">; must be a positive length'),
    ('<unit meter="-1"/>', '<unit meter="-1">; must be a positive length'),
    ('<unit meter="nan"/>', '<unit meter="nan">; must be a positive length'),
    ('<unit meter="inch"/>', '<unit meter="inch">; must be a positive length'),
    ("<up_axis>UP</up_axis>", "<up_axis>UP; must be one of X_UP, Y_UP, Z_UP"),
])  # fmt: skip
def test_a_unit_that_is_none_is_named(
    content: str, message: str, tmp_path: Path
) -> None:
    file = tetrahedron(tmp_path / "mesh.dae")
    file.write_text(file.read_text().replace("<asset>", f"<asset>{content}"))
    with pytest.raises(SceneError, match=message):
        Mesh(file).geometry()
    with pytest.raises(ModelError, match=f"a collision mesh: .*mesh.dae: {message}"):
        link_shapes(odd_robot(tmp_path, collision(f'<mesh filename="{file.name}"/>')))


def test_only_the_file_s_own_asset_is_used(tmp_path: Path) -> None:
    """A later geometry may have another unit."""
    file = tetrahedron(tmp_path / "mesh.dae", "0.01", "Z_UP")
    other = '<asset><unit meter="7"/><up_axis>Y_UP</up_axis></asset><mesh>'
    file.write_text(file.read_text().replace("<mesh>", other))
    assert mesh_units(file) == (0.01, "Z_UP")
