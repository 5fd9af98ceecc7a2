"""Soft limits and axes of planar joints are applied; Pinocchio's parser skips both."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from robot_texts import ARM, joint, link, robot_xml

from hsp_control import Robot
from hsp_control.common.arrays import Array

Write = Callable[..., Path]


def soft(lower: float, upper: float) -> str:
    return (
        f'<safety_controller k_position="20" k_velocity="10" soft_lower_limit="{lower}"'
        f' soft_upper_limit="{upper}"/></joint>'
    )


@pytest.mark.parametrize(("given", "kept"), [
    ((-0.1, 0.2), (-0.1, 0.2)),
    ((-9.0, 0.2), (-3.0, 0.2)),
    ((0.0, 0.0), (-3.0, 3.0)),  # none
    ((0.5, 0.5), (-3.0, 3.0)),
])  # fmt: skip
def test_soft_limits_are_limits(
    given: tuple[float, float], kept: tuple[float, float], write: Write
) -> None:
    robot = Robot.load(write(ARM.replace("</joint>", soft(*given), 1)))
    lower, upper = robot.position_limits()
    assert (lower[0], upper[0]) == kept
    assert (lower[1], upper[1]) == (-3.0, 3.0)


def test_soft_limits_of_followers_and_of_unlimited_joints_apply(write: Write) -> None:
    text = ARM.replace('lower="-3" upper="3"', "", 1)
    text = text.replace("</joint>", soft(-0.1, 0.2), 1)
    lower, upper = Robot.load(write(text)).position_limits()
    assert (lower[0], upper[0]) == (-0.1, 0.2)
    follower = '<mimic joint="shoulder" multiplier="2"/>'
    text = ARM.replace(
        '"elbow" type="revolute">', f'"elbow" type="revolute">{follower}'
    )
    head, tail = text.rsplit("</joint>", 1)
    lower, upper = Robot.load(write(f"{head}{soft(-0.1, 0.2)}{tail}")).position_limits()
    np.testing.assert_allclose([lower[0], upper[0]], [-0.05, 0.1])


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -2, 0), (0, 0, 1), (1, 2, 3), None])
def test_a_planar_joint_moves_in_the_plane_of_its_axis(
    axis: tuple[float, float, float] | None, write: Write
) -> None:
    """It rotates about its axis; the cart and later links are as in the URDF."""
    cart = joint("cart", "base", "cart", "planar")
    text = "" if axis is None else f'<axis xyz="{" ".join(map(str, axis))}"/>'
    cart = cart.replace('<axis xyz="0 0 1"/>', text)
    path = write(
        robot_xml(
            link("base", ""), link("cart"), link("arm"),
            cart, joint("arm", "cart", "arm"),
        )
    )  # fmt: skip
    robot = Robot.load(path)
    assert Robot.load(path, locked={"arm": 0.1}).nv == robot.nv - 1
    place = pin.SE3(pin.rpy.rpyToMatrix(0.3, 0.2, 0.1), np.array([0.5, 0.1, 0.2]))

    def of(frame: str, q: Array) -> pin.SE3:
        found = robot.state(0.0, q, np.zeros(robot.nv)).frame(frame)
        return pin.SE3(found.rotation.copy(), found.position.copy())

    rest = of("cart", robot.neutral())
    np.testing.assert_allclose(rest.homogeneous, place.homogeneous, rtol=0, atol=1e-12)
    normal = place.rotation @ np.array(axis or (0, 0, 1), dtype=float)
    normal /= np.linalg.norm(normal)
    moved = of("cart", robot.integrate(robot.neutral(), np.array([0.4, -0.7, 0, 0])))
    away = moved.translation - rest.translation
    assert np.linalg.norm(away) == pytest.approx(np.hypot(0.4, 0.7))
    assert away @ normal == pytest.approx(0.0, abs=1e-12)
    np.testing.assert_allclose(moved.rotation, rest.rotation, rtol=0, atol=1e-12)
    turned = of("cart", robot.integrate(robot.neutral(), np.array([0, 0, 0.9, 0])))
    np.testing.assert_allclose(
        pin.log3(turned.rotation @ rest.rotation.T), 0.9 * normal, rtol=0, atol=1e-9
    )
    q = robot.integrate(robot.neutral(), np.array([0.4, -0.7, 0.9, 0.3]))
    at_rest = robot.integrate(robot.neutral(), np.array([0, 0, 0, 0.3]))
    np.testing.assert_allclose(
        (of("cart", q).inverse() * of("arm", q)).homogeneous,
        (rest.inverse() * of("arm", at_rest)).homogeneous,
        rtol=0,
        atol=1e-12,
    )


def test_a_continuous_joint_has_no_soft_limits(write: Write) -> None:
    """As it has none: those of the text may even contradict each other."""
    text = ARM.replace('"shoulder" type="revolute"', '"shoulder" type="continuous"')
    robot = Robot.load(write(text.replace("</joint>", soft(8.0, 9.0), 1)))
    lower, upper = robot.position_limits()
    assert (lower[0], upper[0]) == (-np.inf, np.inf)
