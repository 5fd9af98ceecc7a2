"""Reflexes and desired motions: pure functions."""

from typing import Any

import numpy as np
import pytest
from franka_boxes import home, panda
from hypothesis import given
from hypothesis import strategies as st

from hsp_control.companions.franka.layouts import (
    COMMAND,
    PERIOD,
    ControllerMode,
    Error,
    MotionGenerator,
)
from hsp_control.companions.franka_box import reference, reflexes
from hsp_control.companions.franka_box.arm import ACCELERATION, JERK
from hsp_control.companions.franka_box.motion import Motion
from hsp_control.companions.franka_box.reflexes import Reference

REST = np.zeros(7)


def unit(joint: int, value: float) -> Any:
    return value * np.eye(7)[joint]


def errors(found: Any) -> list[Error]:
    return [violation.error for violation in found]


@pytest.mark.parametrize("joint", range(7))
@pytest.mark.parametrize("sign", [-1, 1])
def test_each_limit_of_the_measured_state_is_watched(joint: int, sign: int) -> None:
    limits, q = panda().limits, home()
    edge = limits.upper[joint] if sign > 0 else limits.lower[joint]
    speed, effort = sign * limits.velocity[joint], sign * limits.effort[joint]
    for beyond, found in ((-1e-6, 0), (1e-6, 1)):
        position = q.copy()
        position[joint] = edge + sign * beyond
        cases = {
            Error.JOINT_POSITION_LIMITS_VIOLATION: (position, REST, REST),
            Error.JOINT_VELOCITY_VIOLATION: (
                q,
                unit(joint, speed + sign * beyond),
                REST,
            ),
            Error.TAU_J_RANGE_VIOLATION: (q, REST, unit(joint, effort + sign * beyond)),
        }
        for error, state in cases.items():
            violations = list(reflexes.measured(*state, limits))
            assert errors(violations) == [error] * found
            assert all(f"joint {joint + 1} at" in v.reason for v in violations)


def test_effort_rates_are_relative_to_reported_efforts() -> None:
    before = np.full(7, 40.0 / 3.0).astype(np.float32).astype(float)
    step = np.full(7, 1.0 - 1e-6)
    assert not list(reflexes.effort_rate(before + step, before))
    (violation,) = reflexes.effort_rate(before - step - unit(4, 0.5), before)
    assert violation.error is Error.CONTROLLER_TORQUE_DISCONTINUITY
    assert "joint 5 at -1500 N·m/s; limit -1000" in str(violation)


def test_each_limit_of_a_commanded_motion_is_watched() -> None:
    limits, start = panda().limits, Reference(home(), REST, REST)

    def found(velocity: Any) -> list[Error]:
        new = reference.to_velocity(velocity, start)
        return errors(reflexes.commanded_motion(new, start, limits))

    gentle, jerky, sudden = 0.9 * JERK * PERIOD**2, 1.5 * JERK * PERIOD**2, 2e-2
    too_fast, acceleration, jerk = reflexes.OF_JOINTS
    assert found(unit(0, gentle)) == []
    assert jerky < ACCELERATION * PERIOD
    assert found(unit(0, jerky)) == [jerk]
    assert found(unit(0, sudden)) == [acceleration, jerk]
    assert found(unit(0, 3.0)) == [too_fast, acceleration, jerk]
    beyond = reference.to_position(limits.upper + 1e-3, start)
    assert errors(reflexes.commanded_motion(beyond, start, limits))[0] is (
        Error.JOINT_POSITION_LIMITS_VIOLATION
    )


def test_a_constant_acceleration_is_no_jerk() -> None:
    limits, most = panda().limits, np.full(7, 0.9 * ACCELERATION)
    before = Reference(home(), 0.1 * most, most)
    new = reference.extrapolated(before)
    assert not list(reflexes.commanded_motion(new, before, limits))


def test_a_lost_command_keeps_the_acceleration() -> None:
    """q(t) = a t²/2 by backward differences: velocity and acceleration are exact."""
    a, motion = unit(3, 2.0), Reference(home(), REST, REST)
    for k in range(1, 6):
        motion = reference.to_velocity(k * PERIOD * a, motion)
    exact = reference.to_velocity(6 * PERIOD * a, motion)
    for mine, theirs in zip(reference.extrapolated(motion), exact, strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-9)


@given(st.lists(st.floats(-3, 3), min_size=7, max_size=7))
def test_braking_comes_to_rest_as_fast_as_it_may(speeds: list[float]) -> None:
    motion, start = Reference(REST, np.array(speeds), REST), np.array(speeds)
    fastest = np.abs(start).max()
    steps = 0
    while motion.dq.any():
        motion, steps = reference.braking(motion), steps + 1
        assert np.abs(motion.ddq).max() <= ACCELERATION * (1 + 1e-9)
    shortest = fastest / (ACCELERATION * PERIOD)
    assert shortest - 1e-6 <= steps <= shortest + 1 + 1e-6
    way = start * np.abs(start) / (2.0 * ACCELERATION)
    np.testing.assert_allclose(motion.q, way, atol=2e-3 * max(fastest, 1e-6))


def test_success_is_counted_over_a_hundred_commands() -> None:
    motion = Motion(1, ControllerMode.EXTERNAL, MotionGenerator.NONE)
    command = np.zeros(1, COMMAND)[0]
    motion.miss()  # before the first command nothing is lost
    assert (motion.success_rate, motion.lost) == (1.0, 0)
    for _ in range(150):
        assert not list(motion.execute(command))
    for _ in range(7):
        motion.miss()
    assert motion.success_rate == pytest.approx(0.93)
    assert motion.lost == 7
    list(motion.execute(command))
    assert (motion.lost, motion.lost_in_all) == (0, 7)
