"""Inverse kinematics reaches poses from forward kinematics, within limits."""

import numpy as np
import pinocchio as pin
import pytest

from hsp_control import Robot
from hsp_control.robot.inverse_kinematics import Reached, Target, reach

Array = np.ndarray


def search(robot: Robot, target: Target, q: Array, preferred: Array | None) -> Reached:
    lower, upper = robot.position_limits()
    if preferred is None:
        preferred = robot.joint_positions(q)
    return reach(robot, target, q, preferred, lower, upper)


def place_at(robot: Robot, q: Array) -> pin.SE3:
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    return data.oMf[robot.model.getFrameId(robot.end_effector)].copy()


@pytest.mark.parametrize("name", ["iiwa14", "panda"])
@pytest.mark.parametrize("rows", [3, 6])
@pytest.mark.parametrize("seed", range(3))
def test_a_place_that_the_robot_has_been_at_is_reached(
    name: str, rows: int, seed: int
) -> None:
    robot, rng = Robot.load(name), np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    near = robot.home() + 0.5 * (q - robot.home())
    place = place_at(robot, near)
    found = search(robot, Target(robot.end_effector, place, rows), robot.home(), None)
    assert found.converged
    lower, upper = robot.position_limits()
    assert (found.q >= lower).all()
    assert (found.q <= upper).all()
    there = place_at(robot, found.q)
    np.testing.assert_allclose(there.translation, place.translation, atol=1e-8)
    if rows == 6:
        np.testing.assert_allclose(there.rotation, place.rotation, atol=1e-8)


def test_beyond_reach_it_comes_as_near_as_the_arm_is_long() -> None:
    robot = Robot.load("planar3r")
    tip = place_at(robot, robot.neutral()).translation
    far = pin.SE3(np.eye(3), 2.0 * tip)
    start = robot.integrate(robot.neutral(), np.array([0.3, -0.5, 0.4]))
    found = search(robot, Target("tip", far, 3), start, None)
    assert not found.converged
    assert abs(found.error - np.linalg.norm(tip)) < 5e-3


def test_limits_hold_where_they_bind() -> None:
    """The same target with an elbow limit just short of the solution."""
    robot = Robot.load("iiwa14")
    target = Target(robot.end_effector, place_at(robot, robot.home()), 3)
    lower, upper = robot.position_limits()
    lower[3] = robot.home()[3] + 0.02
    found = reach(robot, target, robot.home(), robot.home(), lower, upper)
    assert found.converged  # four joints are left for three rows
    assert found.q[3] >= lower[3]
