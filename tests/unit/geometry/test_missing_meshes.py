"""Collision meshes that do not exist are left out, with a warning that names them."""

import logging
from pathlib import Path

import pytest
from odd_robots import collision, odd_robot

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
