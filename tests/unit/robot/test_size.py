"""How far a robot reaches from its first joint, and how inert its joints are."""

from pathlib import Path

import numpy as np
import pytest
from robot_cases import BUNDLED
from robot_texts import INERTIA, joint, link, robot_xml

from hsp_control import Robot

REACH = float(np.linalg.norm([0.5, 0.1, 0.2]))  # of a joint in `robot_texts`


def chain(folder: Path, *kinds: str, scale: float = 1.0) -> Robot:
    """Return a chain of joints, as large as it is told."""
    parts = [link("link0", "")]
    for k, kind in enumerate(kinds):
        parts += [link(f"link{k + 1}", INERTIA)]
        parts += [joint(f"joint{k}", f"link{k}", f"link{k + 1}", kind)]
    x, y, z = scale * np.array([0.5, 0.1, 0.2])
    xml = robot_xml(*parts).replace('xyz="0.5 0.1 0.2"', f'xyz="{x} {y} {z}"')
    path = folder / "chain.urdf"
    path.write_text(xml)
    return Robot.load(path)


def test_size_of_a_robot() -> None:
    assert Robot.load("planar3r").size == pytest.approx(3.0, abs=1e-15)
    assert 0.85 < Robot.load("panda").size < 1.2


@pytest.mark.parametrize("scale", [0.01, 1.0, 100.0])
def test_size_grows_with_the_links(scale: float, tmp_path: Path) -> None:
    """From the first joint on: where it stands does not count."""
    arm = chain(tmp_path, "revolute", "revolute", "continuous", scale=scale)
    assert arm.size == pytest.approx(2.0 * scale * REACH, rel=1e-12)


def test_a_prismatic_joint_counts_with_its_range(tmp_path: Path) -> None:
    assert chain(tmp_path, "revolute", "prismatic").size == pytest.approx(REACH + 6.0)
    assert chain(tmp_path, "prismatic", "revolute").size == pytest.approx(REACH + 6.0)
    assert chain(tmp_path, "revolute").size == 0.0


@pytest.mark.parametrize("name", [*BUNDLED, "panda_fingers"])
def test_largest_inertias_are_about_the_largest(name: str) -> None:
    """Of 64 postures; 300 others exceed them by 15 % at most."""
    robot = Robot.load("panda", locked={}) if name.endswith("s") else Robot.load(name)
    rng, v = np.random.default_rng(1), np.zeros(robot.nv)
    drawn = [robot.random_configuration(rng) for _ in range(300)]
    for q in [robot.home(), *drawn]:
        inertias = np.diag(robot.state(0.0, q, v).mass_matrix)
        assert (inertias <= 1.15 * robot.largest_inertias).all()
    assert (robot.largest_inertias > 0.0).all()
