"""Orientation and pointing tasks near half a turn, where the error jumps."""

from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from loaded_robots import panda
from places import THOROUGH
from task_cases import GAINS, TIME, TOOL, Case, Pose, Tumble, frame_along, place

from hsp_control import Controller, FrameOrientation, Gains, Pointing, simulate
from hsp_control.common.arrays import Array
from hsp_control.trajectories import HoldOrientation

near_pi = st.one_of(
    st.floats(0.0, 2.0 * np.pi),
    st.floats(0.0, 16.0).map(lambda k: np.pi - 10.0**-k),
    st.floats(0.0, 16.0).map(lambda k: np.pi + 10.0**-k),
    st.just(np.pi),
)
directions = (
    st.tuples(*[st.floats(-1.0, 1.0)] * 3)
    .map(np.array)
    .filter(lambda a: np.linalg.norm(a) > 1e-3)
    .map(lambda a: a / np.linalg.norm(a))
)


@cache
def panda_state() -> Any:
    """Return the Panda in motion, away from singularities."""
    motion = place(Case("panda", Pose("panda_tcp")), 12)
    return motion.robot.state(TIME, motion.q, motion.v)


@pytest.mark.slow
@settings(max_examples=300 if THOROUGH else 100, deadline=None, derandomize=True)
@given(near_pi, directions)
@example(np.pi, np.array([1.0, 0.0, 0.0]))
@example(np.pi, np.array([0.0, 1.0, 0.0]))
@example(np.pi, np.array([0.0, 0.0, 1.0]))
@example(np.pi, np.array([1.0, 1.0, 0.0]) / np.sqrt(2.0))
@example(0.0, np.array([0.0, 0.0, 1.0]))
def test_orientation_through_half_a_turn(angle: float, axis: Array) -> None:
    """‖e‖ ≤ pi; its rate and the acceleration are bounded.

    ‖Jlog‖ ≤ pi/2 up to pi, so |e'| ≤ pi/2 |w̃|; a few hundred rad/s² at these gains.
    """
    state = panda_state()
    R = state.frame("panda_tcp").rotation
    reference = Tumble(R @ pin.exp3(-angle * axis))
    task = FrameOrientation("panda_tcp", reference, gains=GAINS)
    sample = task.evaluate(state)
    assert np.linalg.norm(sample.error) <= np.pi * (1 + 1e-15)
    shortest = min(angle, 2.0 * np.pi - angle)
    assert np.linalg.norm(sample.error) == pytest.approx(shortest, abs=1e-14)
    w = state.frame("panda_tcp").velocity[3:] - reference.sample(TIME).angular_velocity
    assert np.linalg.norm(sample.error_rate) <= 0.5 * np.pi * np.linalg.norm(w) + 1e-12
    assert np.abs(sample.acceleration).max() < 500.0


@pytest.mark.slow
@settings(max_examples=300 if THOROUGH else 100, deadline=None, derandomize=True)
@given(near_pi, st.floats(-np.pi, np.pi), st.sampled_from(["still", "tumbling"]))
@example(np.pi, 0.0, "still")
@example(np.pi, 0.0, "tumbling")
@example(np.pi, 1.0, "tumbling")
def test_pointing_through_the_antipode(angle: float, side: float, kind: str) -> None:
    """Never NaN; |e| is tan(angle/2) as long as 1 + cos(angle) ≥ 0.02, √99 beyond.

    The terms of second order reach 30 |n'|², with |n'| up to 3 rad/s here.
    """
    state = panda_state()
    m = state.frame("panda_tcp").rotation[:, 2]
    across = np.array([np.cos(side), np.sin(side), 0.0])
    n = np.sin(angle) * across + np.array([0.0, 0.0, np.cos(angle)])
    R_d = frame_along(m) @ frame_along(n / np.linalg.norm(n)).T
    reference = Tumble(R_d) if kind == "tumbling" else HoldOrientation(R_d)
    task = Pointing("panda_tcp", axis=TOOL, trajectory=reference, gains=GAINS)
    sample = task.evaluate(state)
    assert all(np.isfinite(array).all() for array in sample)
    length = np.linalg.norm(sample.error)
    if 1.0 + np.cos(angle) > 0.0201:
        expected = abs(np.tan(0.5 * angle))
        assert length == pytest.approx(expected, rel=1e-12, abs=1e-14)
    if 1.0 + np.cos(angle) < 0.0199:
        assert length == pytest.approx(np.sqrt(99.0), rel=1e-12)
        assert np.linalg.norm(sample.error_rate) < 3.0 / 0.02
    assert np.abs(sample.acceleration).max() < 300.0


@pytest.mark.parametrize("degrees", [150.0, 170.0, 179.0])
def test_pointing_is_led_back_from_near_the_antipode(degrees: float) -> None:
    """From rest along the great circle, never to the opposite pole."""
    robot, q0 = panda(), panda().home()
    here = robot.state(0.0, q0, np.zeros(7)).frame("panda_tcp").rotation[:, 2].copy()
    angle = np.radians(degrees)
    seen = np.array([np.sin(angle), 0.0, np.cos(angle)])
    wanted = HoldOrientation(frame_along(here) @ frame_along(seen).T)
    task = Pointing(
        "panda_tcp", axis=TOOL, trajectory=wanted, gains=Gains(natural_frequency=3.0)
    )
    run = simulate(Controller(robot, [task]), q0, duration=8.0, log_period=0.1)
    n = run["task.panda_tcp_pointing.actual"] @ wanted.rotation
    angles = np.arctan2(np.hypot(n[:, 0], n[:, 1]), n[:, 2])
    assert angles[0] == pytest.approx(angle, abs=1e-12)
    assert (np.diff(angles) < 0.0).all()
    assert angles[-1] < 1e-3
    np.testing.assert_allclose(n[:, 1], 0.0, rtol=0, atol=1e-7)
