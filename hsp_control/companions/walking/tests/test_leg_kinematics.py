"""Contacts from the legs' joints equal those of the whole configuration."""

import numpy as np
import pytest

from hsp_control import Robot
from hsp_control.companions.walking.estimation.leg_kinematics import (
    LegKinematics,
    rolled,
)
from hsp_control.constraints.contacts import BallContact, PointContact, SurfaceContact

pytest.importorskip("example_robot_data")
CASES = {
    "talos": (
        "imu_link",
        SurfaceContact("left_sole_link", length=0.2, width=0.1, center=[0.01, 0, 0]),
    ),
    "solo12": ("base_link", BallContact("FL_FOOT", radius=0.02)),
}


@pytest.fixture(scope="module", params=CASES)
def case(request):
    robot, random = Robot.load(request.param), np.random.default_rng(3)
    frame, contact = CASES[request.param]
    q = robot.integrate(robot.home(), 0.3 * random.normal(size=robot.nv))
    return robot, frame, contact, q, random.normal(size=robot.nv)


def test_points_are_seen_from_the_unit(case):
    robot, frame, contact, q, v = case
    legs = LegKinematics(robot, frame, [contact])
    legs.update(q, v)
    state = robot.state(0.0, q, v)
    unit, foot = state.frame(frame), state.frame(contact.frame)
    places = foot.position + contact.points @ foot.rotation.T
    expected = (places - unit.position) @ unit.rotation
    assert legs.seen(contact).points == pytest.approx(expected)
    turning = unit.rotation.T @ (foot.velocity[3:] - unit.velocity[3:])
    assert legs.seen(contact).turning == pytest.approx(turning)


def test_the_unit_moves_in_the_root_as_in_the_world(case):
    robot, frame, contact, q, v = case
    legs = LegKinematics(robot, frame, [contact])
    legs.update(q, v)
    R_unit, p_unit, twist = legs.unit
    state = robot.state(0.0, q, v)
    R, p = state.data.oMi[1].rotation, state.data.oMi[1].translation
    unit = state.frame(frame)
    assert R @ R_unit == pytest.approx(unit.rotation)
    assert p + R @ p_unit == pytest.approx(unit.position)
    assert R @ (v[3:6] + twist[3:]) == pytest.approx(unit.velocity[3:])
    linear = R @ (v[:3] + np.cross(v[3:6], p_unit) + twist[:3])
    assert linear == pytest.approx(unit.velocity[:3])


def test_the_jacobian_is_the_derivative_by_the_joints(case):
    robot, frame, contact, q, v = case
    legs, step = LegKinematics(robot, frame, [contact]), 1e-6

    def points(displacement):
        legs.update(robot.integrate(q, displacement), v)
        return legs.seen(contact).points.ravel()

    legs.update(q, v)
    J = legs.seen(contact).jacobian
    for k in range(robot.nv):
        e = step * np.eye(robot.nv)[k]
        difference = (points(e) - points(-e)) / (2.0 * step)
        assert pytest.approx(difference, abs=1e-8) == J[:, k]
    assert not J[:, :6].any()


def test_a_ball_rolls_and_others_do_not():
    """The point below the centre is at rest: c' + ω × (-r n) = 0."""
    omega, normal = np.array([0.3, -2.0, 0.5]), np.array([0.0, 0.6, 0.8])
    ball = BallContact("foot", radius=0.05, normal=normal)
    way = rolled(ball, omega, 0.01)
    assert way / 0.01 + np.cross(omega, -0.05 * normal) == pytest.approx(np.zeros(3))
    assert not rolled(PointContact("foot"), omega, 0.01).any()
