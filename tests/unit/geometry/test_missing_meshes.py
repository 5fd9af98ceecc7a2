"""Collision meshes that do not exist are left out, with a warning that names them."""

import logging
from pathlib import Path

import pytest
from odd_robots import FACES, OCTAHEDRON, collision, odd_robot, write_stl

from hsp_control.common.exceptions import ModelError
from hsp_control.geometry import link_shapes

BALL = collision('<sphere radius="0.1"/>')


def test_primitives_serve_and_the_missing_mesh_is_named(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    mesh = collision('<mesh filename="package://acme_arm/upper.stl"/>')
    robot = odd_robot(tmp_path, arm=mesh, base=BALL)
    with caplog.at_level(logging.WARNING):
        (ball,) = link_shapes(robot)
        (again,) = link_shapes(robot, "hulls")
    assert ball.link == again.link == "base"
    (record,) = caplog.records  # said once
    text = record.getMessage()
    assert "of 1 links are missing, which distances therefore do not see: arm" in text
    assert "(package://acme_arm/upper.stl)" in text
    assert "ROS_PACKAGE_PATH=<the folder that contains acme_arm>" in text


def test_a_folder_in_ros_package_path_is_the_cure(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    package = tmp_path / "elsewhere" / "acme_arm"
    package.mkdir(parents=True)
    write_stl(package / "upper.stl", OCTAHEDRON, FACES)
    mesh = collision('<mesh filename="package://acme_arm/upper.stl"/>')
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(package.parent))
    robot = odd_robot(tmp_path, arm=mesh, base=BALL)
    assert [shape.link for shape in link_shapes(robot)] == ["base", "arm"]
    assert not caplog.records


@pytest.mark.parametrize(
    ("name", "hint"),
    [
        ("package://acme_arm/upper.stl", "ROS_PACKAGE_PATH=<the folder that contains"),
        ("upper.stl", "the path is relative to the URDF"),
    ],
)
def test_nothing_is_left(name: str, hint: str, tmp_path: Path) -> None:
    robot = odd_robot(tmp_path, arm=collision(f'<mesh filename="{name}"/>'))
    with pytest.raises(ModelError, match=f"no file '{name}', and no other .*{hint}"):
        link_shapes(robot)
