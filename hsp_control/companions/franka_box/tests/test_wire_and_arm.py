"""The layouts of the protocol, and the arm as clients receive it."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from franka_boxes import panda

from hsp_control import Robot
from hsp_control.companions.franka.layouts import (
    COMMAND,
    HEADER,
    REQUESTS,
    STATE,
    FrankaCommand,
)
from hsp_control.companions.franka_box.arm import Arm, ArmLimits

FR3_URDF_LIMITS = {
    "lower": [-2.7501, -1.7918, -2.9065, -3.0481, -2.8101, 0.54092, -3.01960],
    "upper": [2.7501, 1.7918, 2.9065, -0.1458, 2.8101, 4.52050, 3.01960],
    "velocity": [2.62, 2.62, 2.62, 2.62, 5.26, 4.18, 5.26],
    "effort": [87, 87, 87, 87, 12, 12, 12],
    "velocity_offset": [0.30, 0.20, 0.20, 0.30, 0.35, 0.35, 0.35],
    "deceleration": [6.0, 2.585, 3.5, 4.0, 17.0, 5.5, 17.0],
}


def test_the_layouts_have_the_sizes_of_the_packed_structures() -> None:
    """Sizes and offsets by a C++ compiler for libfranka-common's headers."""
    sizes = {command: layout.itemsize for command, layout in REQUESTS.items()}
    assert (HEADER.itemsize, STATE.itemsize, COMMAND.itemsize) == (12, 1377, 371)
    assert sizes == {
        FrankaCommand.CONNECT: 4,
        FrankaCommand.MOVE: 113,
        FrankaCommand.STOP_MOVE: 0,
        FrankaCommand.SET_COLLISION_BEHAVIOR: 416,
        FrankaCommand.SET_JOINT_IMPEDANCE: 56,
        FrankaCommand.SET_CARTESIAN_IMPEDANCE: 48,
        FrankaCommand.SET_GUIDING_MODE: 7,
        FrankaCommand.SET_EE_TO_K: 128,
        FrankaCommand.SET_NE_TO_EE: 128,
        FrankaCommand.SET_LOAD: 104,
        FrankaCommand.AUTOMATIC_ERROR_RECOVERY: 0,
        FrankaCommand.GET_ROBOT_MODEL: 0,
    }


@pytest.mark.parametrize("name", ["panda", "iiwa14"])
def test_the_model_sent_to_clients_has_the_same_dynamics(name: str) -> None:
    robot = Robot.load(name)
    arm = Arm(robot)
    reported = pin.buildModelFromXML(arm.urdf)
    reported.inertias[7] += arm.flange.act(arm.end_effector)
    random = np.random.default_rng(1)
    for _ in range(20):
        q, v, a = random.normal(size=(3, 7))
        np.testing.assert_allclose(
            pin.rnea(reported, reported.createData(), q, v, a),
            robot.inverse_dynamics(q, v, a),
            atol=1e-12,
        )
    for mine, theirs in (
        (reported.lowerPositionLimit, robot.model.lowerPositionLimit),
        (reported.upperPositionLimit, robot.model.upperPositionLimit),
        (reported.upperVelocityLimit, robot.model.upperVelocityLimit),
        (reported.upperEffortLimit, robot.model.upperEffortLimit),
    ):
        assert mine.tolist() == theirs.tolist()


def test_a_load_is_one_more_body() -> None:
    arm = panda()
    load = pin.Inertia(2.0, np.array([0.0, 0.1, 0.2]), np.eye(3))
    carrying, rest = arm.carrying(load), np.zeros(7)
    q = arm.robot.home() + 0.3  # the hand is not vertical
    state = arm.robot.state(0.0, q, rest)
    flange = state.frame("panda_link8")
    lever = flange.rotation @ load.lever
    point = flange.jacobian[:3] + np.cross(flange.jacobian[3:].T, lever).T
    more = carrying.inverse_dynamics(q, rest, rest)
    less = arm.robot.inverse_dynamics(q, rest, rest)
    np.testing.assert_allclose(more - less, point.T @ [0, 0, 2 * 9.81], atol=1e-12)


def test_velocity_limits_are_those_that_libfranka_computes() -> None:
    """``computeUpperLimitsJointVelocity`` of libfranka 0.21, without its tolerance."""
    limits = ArmLimits(**{k: np.array(x, float) for k, x in FR3_URDF_LIMITS.items()})
    doubled = [12.0, 5.17, 7.0, 8.0, 34.0, 11.0, 34.0]
    for share in (0.02, 0.3, 0.7, 0.999, 1.1):
        q = limits.lower + share * (limits.upper - limits.lower)
        lowest, highest = limits.velocities(q)
        for k in range(7):
            offset, most = limits.velocity_offset[k], limits.velocity[k]
            up, down = (
                min(most, max(0.0, -offset + np.sqrt(max(0.0, doubled[k] * room))))
                for room in (limits.upper[k] - q[k], q[k] - limits.lower[k])
            )
            assert (highest[k], lowest[k]) == pytest.approx((up, -down))


def test_velocity_limits_are_read_beside_transmissions(tmp_path: Path) -> None:
    """A URDF repeats joint names in its transmissions."""
    urdf, arm = panda().robot.source.urdf.read_text(), tmp_path / "arm.urdf"
    slower = '<position_based_velocity_limits velocity_offset="0.3"/>'
    driven = '<transmission name="t"><joint name="panda_joint3"/></transmission>'
    joint = '<joint name="panda_joint3" type="revolute">'
    assert joint in urdf
    urdf = urdf.replace(joint, joint + slower)
    arm.write_text(urdf.replace("</robot>", f"{driven}</robot>"))
    found = Arm(Robot.load(arm, locked={"panda_finger_joint1": 0.0})).limits
    assert found.velocity_offset.tolist() == [0.0, 0.0, 0.3, 0.0, 0.0, 0.0, 0.0]
