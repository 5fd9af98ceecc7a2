"""A pull at a link: its power equals that of the force at its point of action."""

from pathlib import Path

import numpy as np
import pytest
from robot_kinds import KINDS

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.simulation.plants import Push
from hsp_control.simulation.plants.push import Pushes, Spring

kinds = pytest.mark.parametrize("kind", KINDS)


def point_of(robot: Robot, q: Array, joint: int, point: Array) -> Array:
    """Return the world position of a point on a joint, shape (3,) [m]."""
    state = robot.state(0.0, q, np.zeros(robot.nv))
    return np.array(state.data.oMi[joint].act(point))


@kinds
def test_a_pull_has_the_power_of_its_force(kind: str, tmp_path: Path) -> None:
    """tauᵀ v = fᵀ p', with p the pulled point, off the joint's origin."""
    robot, rng = KINDS[kind](tmp_path), np.random.default_rng(1)
    pushes = Pushes(robot)
    last = robot.model.njoints - 1
    for joint in {1, last}:
        q = robot.random_configuration(rng)
        v = rng.standard_normal(robot.nv)
        point, hand = rng.uniform(-1.0, 1.0, 3), rng.uniform(-2.0, 2.0, 3)
        spring = pushes.spring = Spring(joint, point, hand, 300.0, 1e9)
        h = 1e-5
        ahead, behind = (
            point_of(robot, robot.integrate(q, s * h * v), joint, point)
            for s in (1.0, -1.0)
        )
        there = point_of(robot, q, joint, point)
        force = 300.0 * (hand - there)
        np.testing.assert_allclose(spring.force(there), force, rtol=1e-12)
        power = float(force @ (ahead - behind)) / (2.0 * h)
        assert pushes.effort(0.0, q) @ v == pytest.approx(power, rel=1e-5, abs=1e-5)


@kinds
def test_a_push_has_the_power_of_its_wrench(kind: str, tmp_path: Path) -> None:
    """tauᵀ v = fᵀ p' + mᵀ ω, at the frame's origin, in world axes."""
    robot, rng = KINDS[kind](tmp_path), np.random.default_rng(2)
    frame = robot.frame_names[-1]
    force, moment = rng.uniform(-9.0, 9.0, (2, 3))
    pushes = Pushes(robot, [Push(frame, force, moment, start=0.5, duration=0.2)])
    q = robot.random_configuration(rng)
    v = rng.standard_normal(robot.nv)
    velocity = robot.state(0.0, q, v).frame(frame).velocity
    power = float(force @ velocity[:3] + moment @ velocity[3:])
    assert pushes.effort(0.6, q) @ v == pytest.approx(power, rel=1e-9, abs=1e-9)
    for t in (0.49, 0.7, 0.71):
        assert not pushes.effort(t, q).any()


def test_a_pull_is_no_stronger_than_its_largest_force() -> None:
    spring = Spring(1, np.zeros(3), np.array([3.0, 4.0, 0.0]), 100.0, 50.0)
    np.testing.assert_allclose(spring.force(np.zeros(3)), [30.0, 40.0, 0.0])
    near = np.array([2.7, 3.6, 0.0])
    np.testing.assert_allclose(spring.force(near), [30.0, 40.0, 0.0], atol=1e-9)
    nearer = np.array([2.97, 3.96, 0.0])
    np.testing.assert_allclose(spring.force(nearer), [3.0, 4.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(spring.force(spring.hand), 0.0)


def test_a_pull_at_the_origin_of_a_joint_does_not_turn_it(tmp_path: Path) -> None:
    """A pull at a point off the axis does, by its lever arm, which rotates with the
    link."""
    robot = KINDS["arm"](tmp_path)
    pushes, q = Pushes(robot), np.zeros(3)
    state = robot.state(0.0, q, np.zeros(3))
    place = state.data.oMi[1].copy()
    axis = place.rotation[:, 2]
    hand = place.translation + np.array([0.3, 0.2, 0.1])
    pushes.spring = Spring(1, np.zeros(3), hand, 100.0, 1e9)
    np.testing.assert_allclose(pushes.effort(0.0, q), 0.0, atol=1e-9)
    point = np.array([0.4, 0.0, 0.0])
    pushes.spring = Spring(1, point, hand, 100.0, 1e9)
    arm = place.rotation @ point
    moment = np.cross(arm, 100.0 * (hand - place.translation - arm))
    assert pushes.effort(0.0, q)[0] == pytest.approx(moment @ axis)
    assert abs(moment @ axis) > 1.0
