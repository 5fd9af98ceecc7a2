"""The view draws meshes of all formats of distances in metres and upright."""

import logging
from pathlib import Path

import numpy as np
import pytest
from mesh_texts import CORNERS, tetrahedron
from odd_robots import odd_robot

from hsp_control.common.arrays import Array
from hsp_control.companions.viewer.packing import read_mesh
from hsp_control.companions.viewer.robot_drawing import (
    RobotDrawing,
    Visual,
    read_visuals,
)
from hsp_control.companions.viewer.threejs import collada_object, mesh_geometry


def visual(name: str) -> str:
    return (
        '<visual><origin xyz="0.1 0.2 0.3" rpy="0 0 1.5707963267948966"/><geometry>'
        f'<mesh filename="{name}" scale="0.1 0.2 0.5"/></geometry></visual>'
    )


def drawn(piece: Visual) -> Array:
    """Return the drawn points in the joint's frame, shape (k, 3) [m]."""
    if piece.mesh is not None:
        points = piece.mesh[0]
    else:
        assert piece.file is not None
        is_collada = piece.file.suffix == ".dae"
        thing = (
            collada_object(piece.file)["object"]
            if is_collada
            else mesh_geometry(piece.file)
        )
        parts = read_mesh(thing, "it")
        points = np.vstack([part.vertices for part in parts]) * piece.size
    return np.asarray(points @ piece.pose[:3, :3].T + piece.pose[:3, 3])


@pytest.mark.parametrize(("name", "unit", "up"), [
    ("mesh.dae", "0.01", "Z_UP"), ("mesh.dae", "0.0254", "Y_UP"),
    ("mesh.dae", None, "X_UP"), ("mesh.gltf", None, None), ("mesh.ply", None, None),
    ("mesh.off", None, None), ("mesh.obj", None, None),
])  # fmt: skip
def test_a_mesh_is_drawn_where_it_is(
    name: str, unit: str | None, up: str | None, tmp_path: Path
) -> None:
    file = tetrahedron(tmp_path / name, unit, up)
    (piece,) = read_visuals(odd_robot(tmp_path, visual(file.name)))
    found = drawn(piece)
    x, y, z = (CORNERS * (0.1, 0.2, 0.5)).T
    expected = np.array([0.1 - y, 0.2 + x, 0.3 + z]).T  # rotated by 90°
    away = np.linalg.norm(found[:, None] - expected[None], axis=2)
    assert max(away.min(axis=0).max(), away.min(axis=1).max()) < 1e-6


def test_files_that_are_no_meshes_are_reported(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    (tmp_path / "mesh.ply").write_text("no mesh")
    robot = odd_robot(tmp_path, visual("mesh.ply"))
    with caplog.at_level(logging.WARNING):
        RobotDrawing(robot)
    assert "1 of 1 meshes are not found or cannot be read" in caplog.text
