"""Robots loaded by name and by path, and their roots."""

import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import covering
from refused_robots import NO_HAND_MASS, NO_LEADER, REFUSED
from robot_texts import ARM, assert_same_placements, link, placements

from hsp_control import Robot
from hsp_control.common import resources
from hsp_control.common.errors import ModelError, RobotNotFoundError
from hsp_control.common.resources import bundled_robots
from hsp_control.robot import RobotDescription
from hsp_control.robot.description.loading import load_model
from hsp_control.robot.description.mesh_files import candidates
from hsp_control.robot.description.sources import example_robots, find_robot
from hsp_control.robot.description.urdf import read_urdf

# Robots of example-robot-data that are refused, and why. (cassie is not listed at all:
# it is no URDF.)
REFUSED_WITHOUT_MIMIC = {"romeo": r"no mass moves with LFinger21, .*\(24 in all\)"}


def example(name: str) -> Robot:
    pytest.importorskip("example_robot_data")
    return Robot.load(name)


# --- by name -------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "mimic"), covering(sorted(example_robots()), [True, False])
)
def test_every_example_robot_loads_or_gives_the_reason(name: str, mimic: bool) -> None:
    """Only ModelError is raised, for exactly the listed robots."""
    reason = REFUSED.get(name)
    if not mimic and reason in {NO_HAND_MASS, NO_LEADER}:
        reason = REFUSED_WITHOUT_MIMIC.get(name)
    source = find_robot(name)
    if source.origin == "bundled":
        source = example_robots()[name]
    settings = RobotDescription(name, mimic=mimic)
    if reason is not None:
        with pytest.raises(ModelError, match=reason):
            load_model(source, settings)
        return
    robot = Robot(load_model(source, settings), source)
    plain = pin.buildModelFromUrdf(str(source.urdf))
    extra = 6 if source.root == "free_flyer" else 0
    joints = read_urdf(source).findall("joint") if mimic else []
    following = [j for j in joints if j.find("mimic") is not None]
    following = [j for j in following if j.get("type") != "fixed"]
    assert robot.nv == plain.nv + extra - len(following)
    # The root comes first, then the URDF's joints without mimicking ones.
    assert len(robot.dof_names) == robot.nv
    assert len(robot.joint_names) == len(robot.joints)
    last = list(robot.joints.values())[-1]
    assert last.idx_v + last.nv == robot.nv
    assert last.idx_q + last.nq == robot.nq


def test_sdf_only_robot_is_not_listed_and_is_refused_by_name() -> None:
    pytest.importorskip("example_robot_data")
    assert len(example_robots()) >= 70
    assert "cassie" not in example_robots()
    with pytest.raises(RobotNotFoundError, match=r"'cassie' .* has no URDF"):
        Robot.load("cassie")


def test_without_example_robot_data(monkeypatch: pytest.MonkeyPatch) -> None:
    """Bundled robots still load; the error for others names the package to install."""
    real = importlib.util.find_spec

    def find_spec(name: str, package: str | None = None) -> Any:
        return None if name == "example_robot_data" else real(name, package)

    monkeypatch.setattr(importlib.util, "find_spec", find_spec)
    assert example_robots() == {}
    assert Robot.load("panda").nv == 7
    with pytest.raises(RobotNotFoundError, match="pip install example-robot-data-loa"):
        find_robot("talos_arm")


def test_bundled_folder_of_a_wheel(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In a wheel the data are in the package; a folder without a URDF is no robot."""
    arm = tmp_path / "data" / "robots" / "arm"
    arm.mkdir(parents=True)
    (arm / "arm.urdf").write_text(ARM)
    (tmp_path / "data" / "robots" / "empty").mkdir()
    monkeypatch.setattr(resources, "_PACKAGE", tmp_path)
    assert bundled_robots() == {"arm": arm}
    assert Robot.load("arm").joint_names == ("shoulder", "elbow")


# --- by path -------------------------------------------------------------------------


def test_package_folders_of_a_file(
    write: Callable[..., Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    """`package://` is looked up above the file, then along ROS_PACKAGE_PATH."""
    path = write(ARM)
    monkeypatch.setenv("ROS_PACKAGE_PATH", "/opt/one:/opt/two")
    found = candidates(find_robot(path), "package://arm/a.stl")
    places = [each.parent.parent for each in found]
    assert places[0] == path.resolve().parent
    assert path.resolve().parents[2] in places
    assert places[-2:] == [Path("/opt/one"), Path("/opt/two")]
    monkeypatch.delenv("ROS_PACKAGE_PATH")
    found = candidates(find_robot(path), "package://arm/a.stl")
    assert Path("/opt/one/arm/a.stl") not in found


# --- roots ---------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("root", "nq", "nv"), [("fixed", 2, 2), ("planar", 6, 5), ("free_flyer", 9, 8)]
)
def test_root(root: Any, nq: int, nv: int, write: Callable[..., Path]) -> None:
    text = ARM.replace(link("base", ""), link("base"))  # a root needs mass
    robot = Robot.load(write(text), root=root)
    fixed = Robot.load(write(text))
    assert (robot.nq, robot.nv) == (nq, nv)
    # Frames move with the root; the pose follows Pinocchio's conventions.
    angles = np.array([0.4, -0.7])
    if root == "fixed":
        pose, q = pin.SE3.Identity(), angles
    elif root == "planar":
        pose = pin.SE3(pin.rpy.rpyToMatrix(0, 0, 0.6), np.array([1.0, -2.0, 0.0]))
        q = np.concatenate([[1.0, -2.0, np.cos(0.6), np.sin(0.6)], angles])
    else:
        pose = pin.SE3(pin.rpy.rpyToMatrix(0.1, -0.5, 0.6), np.array([1.0, -2.0, 0.5]))
        q = np.concatenate([pin.SE3ToXYZQUAT(pose), angles])
    standing = placements(fixed.model, angles)
    moved = {name: pose.homogeneous @ M for name, M in standing.items()}
    assert_same_placements(moved, placements(robot.model, q))
    np.testing.assert_array_equal(robot.check_configuration(q), q)
