"""The configuration space: joint types, limits, home and random draws."""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin
import pytest
from refused_robots import REFUSED
from robot_cases import BUNDLED, ROBOTS, load

from hsp_control import Robot
from hsp_control.common.errors import ConfigurationError, ShapeError
from hsp_control.robot.description.sources import RobotSource, example_robots


def hand_built(*joints: Any) -> Robot:
    """Return a chain of the given joints, each with a body of mass."""
    model, parent = pin.Model(), 0
    for number, joint in enumerate(joints):
        placement = pin.SE3(np.eye(3), np.array([0.1, 0.2, 0.3]))
        parent = model.addJoint(parent, joint, placement, f"j{number}")
        inertia = pin.Inertia.FromSphere(1.0, 0.1)
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
    return Robot(model, RobotSource("hand_built", Path("nowhere.urdf")))


def test_unit_blocks() -> None:
    """Indices of quaternions and (cos, sin) pairs in q."""
    robot = hand_built(
        pin.JointModelFreeFlyer(),  # x y z, quaternion
        pin.JointModelRX(),
        pin.JointModelRUBZ(),  # (cos, sin)
        pin.JointModelPlanar(),  # x y, (cos, sin)
        pin.JointModelSpherical(),  # quaternion
        pin.JointModelPY(),
        pin.JointModelRUBX(),
    )
    assert robot.nq == 7 + 1 + 2 + 4 + 4 + 1 + 2
    assert robot.unit_blocks == ((3, 4), (8, 2), (12, 2), (14, 4), (19, 2))
    assert not robot.flat
    # Exactly these blocks are normalised by Pinocchio.
    q = np.full(robot.nq, 3.0)
    normalised = pin.normalize(robot.model, q)
    changed = np.zeros(robot.nq, dtype=bool)
    for start, size in robot.unit_blocks:
        changed[start : start + size] = True
    np.testing.assert_array_equal(normalised != q, changed)
    robot.check_configuration(normalised)
    for start, size in robot.unit_blocks:
        spoilt = normalised.copy()
        spoilt[start : start + size] *= 1.5
        kind = "quaternion" if size == 4 else "(cos, sin) pair"
        with pytest.raises(
            ConfigurationError, match=re.escape(f"is a {kind} of norm 1.5")
        ):
            robot.state(0.0, spoilt, np.zeros(robot.nv))
    # Joints added in Python have no limits unless given.
    lower, upper = robot.position_limits()
    np.testing.assert_array_equal(lower, np.full(robot.nv, -np.inf))
    np.testing.assert_array_equal(upper, np.full(robot.nv, np.inf))
    rng = np.random.default_rng(0)
    robot.check_configuration(robot.random_configuration(rng))
    np.testing.assert_array_equal(robot.home(), robot.neutral())


@pytest.mark.slow
@pytest.mark.parametrize("case", ROBOTS)
def test_position_limits(case: str) -> None:
    """The URDF's for joints with one coordinate; none for continuous joints and
    roots."""
    robot = load(case)
    lower, upper = robot.position_limits()
    urdf = ElementTree.parse(robot.source.urdf)
    for name, joint in robot.joints.items():
        where = slice(joint.idx_v, joint.idx_v + joint.nv)
        if joint.nq == 1:
            limit = urdf.find(f"joint[@name='{name}']/limit")
            soft = urdf.find(f"joint[@name='{name}']/safety_controller")
            assert limit is not None
            low, high = float(limit.attrib["lower"]), float(limit.attrib["upper"])
            if soft is not None:
                low = max(low, float(soft.get("soft_lower_limit", -np.inf)))
                high = min(high, float(soft.get("soft_upper_limit", np.inf)))
            assert (lower[where], upper[where]) == (low, high)
        else:
            assert (lower[where] == -np.inf).all(), name
            assert (upper[where] == np.inf).all(), name


def test_home_is_the_sources_or_neutral_or_the_middle_of_the_range() -> None:
    panda = load("panda")
    np.testing.assert_array_equal(panda.home(), panda.source.home)
    # One joint locked: the recommended posture no longer fits, so limits decide. The
    # fourth joint's range, -3.0718 to -0.0698, does not contain 0; the sixth's, -0.0175
    # to 3.7525, just does.
    locks = {"panda_joint1": 0.0, "panda_finger_joint1": 0.0}
    shorter = Robot.load("panda", locked=locks)
    middle = (-3.0718 - 0.0698) / 2
    np.testing.assert_allclose(
        shorter.home(), [0, 0, middle, 0, 0, 0], rtol=0, atol=1e-15
    )
    lower, upper = shorter.position_limits()
    assert ((lower <= shorter.home()) & (shorter.home() <= upper)).all()
    # Continuous joints: home is given as angles.
    np.testing.assert_allclose(
        load("planar3r").joint_positions(load("planar3r").home()),
        np.deg2rad([30, 60, 60]),
        rtol=0,
        atol=1e-15,
    )
    # A legged robot starts in the SRDF's standing posture.
    np.testing.assert_allclose(load("solo12").home()[:7], [0, 0, 0.235, 0, 0, 0, 1])
    np.testing.assert_allclose(load("solo12").home()[7:10], [0.1, 0.8, -1.6])


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*BUNDLED, *example_robots()} - set(REFUSED)))
def test_random_and_home_configurations_are_within_limits(name: str) -> None:
    """For every available robot, with and without a floating root."""
    robot = Robot.load(name)
    lower, upper = robot.position_limits()
    rng = np.random.default_rng(25)
    drawn = [robot.random_configuration(rng) for _ in range(5)]
    for q in (robot.home(), robot.neutral(), *drawn):
        robot.check_configuration(q)
    for q in (robot.home(), *drawn):
        positions = robot.joint_positions(q)
        assert (positions >= lower - 1e-12).all()
        assert (positions <= upper + 1e-12).all()
    # They differ, unless the URDF's limits are 0 and 0 (the double pendulums').
    if (upper > lower).any():
        assert np.abs(robot.difference(drawn[0], drawn[1])).max() > 0.0
    # The same seed gives the same draw.
    again = robot.random_configuration(np.random.default_rng(25))
    np.testing.assert_array_equal(again, drawn[0])


def test_lists_will_do() -> None:
    robot, step = load("panda"), [0.1, 0, 0, 0, 0, 0, -0.2]
    moved = robot.integrate(robot.home().tolist(), step)
    found = robot.difference(robot.home().tolist(), moved.tolist())
    np.testing.assert_allclose(found, step, rtol=0, atol=1e-15)


@pytest.mark.parametrize("wrong", [[0.1], np.zeros(8), "left", None])
def test_integrate_and_difference_name_wrong_shapes(wrong: object) -> None:
    robot = load("panda")
    with pytest.raises(ShapeError, match=r"^displacement (has shape|.*; needs 7 n)"):
        robot.integrate(robot.home(), wrong)
    with pytest.raises(ShapeError, match=r"^configuration q "):
        robot.integrate(wrong, np.zeros(7))
    with pytest.raises(ShapeError, match=r"^configuration q "):
        robot.difference(robot.home(), wrong)
