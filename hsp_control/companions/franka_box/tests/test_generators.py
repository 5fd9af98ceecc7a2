"""Motion generators of the hand: the joints follow, and limits are monitored."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from franka_boxes import command, home, panda

from hsp_control.companions.franka.layouts import PERIOD, Error
from hsp_control.companions.franka_box import hand, reference, reflexes
from hsp_control.companions.franka_box.generators import (
    Generator,
    HandPoses,
    HandTwists,
)
from hsp_control.companions.franka_box.model import Model

STEPS = 1500


def made(kind: type[Any]) -> tuple[Any, Model]:
    model, start = Model(panda()), reference.at_rest(home())
    arguments = [start, panda().limits]
    return kind(*arguments, *([model] if issubclass(kind, HandPoses) else [])), model


def columns(pose: pin.SE3) -> Any:
    return pose.homogeneous.T.ravel()


def follow(generator: Generator, reported: Any, *, first: bool = False) -> list[Error]:
    return [v.error for v in generator.follow(reported, first=first)]


def way(step: int) -> tuple[Any, Any]:
    """Return displacement and twist of a smooth motion out and back, in base axes."""
    t = 2.0 * np.pi * step / STEPS
    most = np.array([0.05, -0.04, 0.06, 0.1, -0.1, 0.2]) / 2.0
    speed = 2.0 * np.pi / (STEPS * PERIOD)
    return most * (1.0 - np.cos(t)), most * speed * np.sin(t)


def test_joints_follow_the_hand_to_its_pose() -> None:
    generator, model = made(HandPoses)
    start = model.hand_at(home())[0]
    for step in range(STEPS + 1):
        moved, _ = way(step)
        pose = pin.SE3(
            pin.exp3(moved[3:]) @ start.rotation, start.translation + moved[:3]
        )
        reported = command(O_T_EE_c=columns(pose))
        assert follow(generator, reported, first=step == 0) == []
        at, J = model.hand_at(generator.reference.q)
        assert np.abs(hand.displacement(pose, at)).max() < 1e-5
        np.testing.assert_allclose(
            J @ generator.reference.dq, generator.hand.twist, atol=2e-3
        )


@pytest.mark.parametrize(("late", "jerk"), [(0, 1800.0), (1, 1800.0), (2, 650.0)])
def test_a_client_that_is_late_for_its_first_commands_has_begun(
    late: int, jerk: float
) -> None:
    """The first command is no start at rest: the second would be a jerk of 19 j/6."""
    generator, model = made(HandPoses)
    start = model.hand_at(home())[0]
    for step in (late, late + 1):
        way = jerk * (step * PERIOD) ** 3 / 6.0 * np.array([1.0, 0.0, 0.0])
        reported = command(
            O_T_EE_c=columns(pin.SE3(start.rotation, start.translation + way))
        )
        assert follow(generator, reported, first=step == late) == []


def test_an_elbow_that_is_commanded_is_reached_by_a_hand_that_stays() -> None:
    generator, model = made(HandPoses)
    start = model.hand_at(home())[0]
    for step in range(STEPS + 1):
        elbow = 0.2 * (1.0 - np.cos(np.pi * step / STEPS)) / 2.0
        reported = command(
            O_T_EE_c=columns(start), valid_elbow=1, elbow_c=[elbow, -1.0]
        )
        assert follow(generator, reported, first=step == 0) == []
        assert generator.reference.q[2] == pytest.approx(elbow, abs=1e-5)
    at, _ = model.hand_at(generator.reference.q)
    assert np.abs(hand.displacement(start, at)).max() < 1e-5


@pytest.mark.parametrize(("first", "elbow", "error"), [
    (True, [0.0, 1.0], Error.CARTESIAN_MOTION_GENERATOR_ELBOW_SIGN_INCONSISTENT),
    (True, [0.1, -1.0], Error.CARTESIAN_MOTION_GENERATOR_START_ELBOW_INVALID),
    (False, [0.1, -1.0], Error.CARTESIAN_MOTION_GENERATOR_ELBOW_LIMIT_VIOLATION),
])  # fmt: skip
def test_an_elbow_elsewhere_is_refused(first: bool, elbow: Any, error: Error) -> None:
    generator, model = made(HandPoses)
    pose = columns(model.hand_at(home())[0])
    reported = command(O_T_EE_c=pose, valid_elbow=1, elbow_c=elbow)
    assert follow(generator, reported, first=first)[0] is error


def test_each_limit_of_a_commanded_hand_is_watched() -> None:
    still = hand.at_rest(panda().nominal_end_effector)
    too_fast, acceleration, jerk = (
        Error.CARTESIAN_MOTION_GENERATOR_VELOCITY_LIMITS_VIOLATION,
        Error.CARTESIAN_MOTION_GENERATOR_VELOCITY_DISCONTINUITY,
        Error.CARTESIAN_MOTION_GENERATOR_ACCELERATION_DISCONTINUITY,
    )
    directions = np.array([[0.6, 0, 0.8, 0, 0, 0], [0, 0, 0, 0, 0.6, -0.8]])
    for k, direction in enumerate(directions):
        jerky = reflexes.HAND_JERK[k] * PERIOD**2
        sudden = reflexes.HAND_ACCELERATION[k] * PERIOD
        for speed, found in (
            (0.99 * jerky, []),
            (1.01 * jerky, [jerk]),
            (1.01 * sudden, [acceleration, jerk]),
            (1.01 * reflexes.HAND_VELOCITY[k], [too_fast, acceleration, jerk]),
        ):
            new = hand.to_twist(speed * direction, still)
            violations = list(reflexes.commanded_hand(new, still))
            assert [v.error for v in violations] == found
            name = ("translation", "rotation")[k]
            assert all(v.reason.startswith(name) for v in violations)


def test_a_hand_starts_where_it_is_and_its_pose_is_one() -> None:
    near, far = np.zeros(6), np.zeros(6)
    near[0], far[0] = 2.9e-3, 3.1e-3
    for moved, found in (
        (near, []),
        (far, [Error.CARTESIAN_POSITION_MOTION_GENERATOR_START_POSE_INVALID]),
    ):
        generator, model = made(HandPoses)
        start = model.hand_at(home())[0]
        pose = pin.SE3(start.rotation, start.translation + moved[:3])
        assert follow(generator, command(O_T_EE_c=columns(pose)), first=True) == found
    generator, _ = made(HandPoses)
    assert follow(generator, command(O_T_EE_c=np.ones(16))) == [
        Error.CARTESIAN_POSITION_MOTION_GENERATOR_INVALID_FRAME_FLAG
    ]


def test_a_twist_is_that_of_the_poses_it_makes() -> None:
    """In base axes, for any orientation of the hand."""
    pose = pin.SE3(pin.rpy.rpyToMatrix(0.3, -0.8, 1.2), np.array([0.3, 0.1, 0.5]))
    before, twist = hand.at_rest(pose), np.array([0.1, -0.2, 0.3, 0.5, -0.4, 0.3])
    made = hand.to_twist(twist, before)
    np.testing.assert_allclose(hand.to_pose(made.pose, before).twist, twist, atol=1e-9)


def test_a_lost_command_keeps_the_acceleration_of_the_hand() -> None:
    """A constant angular acceleration about one axis, and a straight line."""
    a = np.array([0.4, 0.0, 0.2, 0.0, 0.0, 0.8])
    motion = hand.at_rest(pin.SE3.Identity())
    for k in range(1, 6):
        motion = hand.to_twist(k * PERIOD * a, motion)
    exact, mine = hand.to_twist(6 * PERIOD * a, motion), hand.extrapolated(motion)
    assert np.abs(hand.displacement(mine.pose, exact.pose)).max() < 1e-12
    np.testing.assert_allclose(mine.twist, exact.twist, atol=1e-12)
    generator, model = made(HandTwists)
    generator.hand = hand.HandMotion(
        model.hand_at(home())[0], np.zeros(6), np.array([1.0, 0, 0, 0, 0, 0])
    )
    generator.extrapolate()
    at, _ = model.hand_at(generator.reference.q)
    assert at.translation[0] > model.hand_at(home())[0].translation[0]
