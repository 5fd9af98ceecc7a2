"""Mimic joints of all kinds; their limits and friction apply to their leaders."""

import itertools
import logging
import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from robot_kinds import TEXTS, chain, follow
from robot_texts import assert_same_placements, placements
from static_rows import static_rows
from wording import wording

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import StaticEffort
from hsp_control.robot.friction import JointFriction

Write = Callable[..., Path]
TYPES = "revolute", "continuous", "prismatic"


def pair(
    multiplier: float, limits: str = "", dynamics: str = "", leader: str = "revolute"
) -> str:
    """Return a leader and its follower, with the follower's attributes."""
    mimic = follow("leader", multiplier, 0.1)
    text = chain(
        ("leader", leader, ""), ("follower", "revolute", mimic + dynamics),
        ("last", "revolute", ""),
    )  # fmt: skip
    before, after = text.split('<joint name="follower"')
    if limits:
        after = after.replace('lower="-3" upper="3" effort="9" velocity="9"', limits, 1)
    return f'{before}<joint name="follower"{after}'


@pytest.mark.parametrize(
    ("kinds", "multiplier"),
    [*itertools.product(itertools.product(TYPES, TYPES), (1.0, 2.0, -1.5, 0.0))],
)
def test_a_follower_of_any_kind_is_where_it_has_to_be(
    kinds: tuple[str, str], multiplier: float, write: Write
) -> None:
    """Also after several turns of a continuous leader."""
    leader, follower = kinds
    path = write(
        chain(
            ("leader", leader, ""), ("middle", "revolute", ""),
            ("follower", follower, follow("leader", multiplier, 0.3)),
        )
    )  # fmt: skip
    robot, free = Robot.load(path), Robot.load(path, mimic=False)
    assert robot.joint_names == ("leader", "middle")
    for angle in (0.4, -2.0, 4.0):
        q = robot.integrate(robot.neutral(), np.array([angle, -0.7]))
        dq = np.array([angle, -0.7, multiplier * angle + 0.3])
        assert_same_placements(
            placements(robot.model, q),
            placements(free.model, free.integrate(free.neutral(), dq)),
        )


@pytest.mark.parametrize("leader", ["revolute", "continuous"])
@pytest.mark.parametrize(
    ("multiplier", "lower", "upper"), [(2.0, -0.3, 0.2), (-0.5, -0.8, 1.2)]
)
def test_a_follower_bounds_its_leader(
    multiplier: float, lower: float, upper: float, leader: str, write: Write
) -> None:
    """±0.5 rad at multiplier · q + 0.1."""
    limits = 'lower="-0.5" upper="0.5" effort="3" velocity="0.5"'
    robot = Robot.load(write(pair(multiplier, limits, leader=leader)))
    low, high = robot.position_limits()
    np.testing.assert_allclose([low[0], high[0]], [lower, upper], rtol=1e-12)
    assert (low[1], high[1]) == (-3.0, 3.0)
    size = abs(multiplier)
    assert robot.model.velocityLimit[0] == pytest.approx(0.5 / size)
    assert robot.model.effortLimit[0] == pytest.approx(min(9.0, 3.0 * size))
    assert robot.model.lowerEffortLimit[0] == -robot.model.effortLimit[0]
    for angle in (low[0], high[0]):
        assert abs(multiplier * angle + 0.1) <= 0.5 + 1e-12


@pytest.mark.parametrize("limits", [
    'lower="-3" upper="3" effort="9" velocity="9"',  # wider than the leader's
    'lower="0" upper="0" effort="0" velocity="0"',  # none
])  # fmt: skip
def test_limits_wider_than_the_leader_s_have_no_effect(
    limits: str, write: Write
) -> None:
    robot = Robot.load(write(pair(-0.9, limits)))
    lower, upper = robot.position_limits()
    assert (lower[0], upper[0]) == (-3.0, 3.0)
    own = robot.model.velocityLimit[0], robot.model.effortLimit[0]
    assert own == pytest.approx((9.0, 9.0 if 'effort="0"' in limits else 8.1))


def test_limits_that_contradict_are_named(
    write: Write, caplog: pytest.LogCaptureFixture
) -> None:
    """Such grippers exist; their leaders move within their own limits."""
    limits = 'lower="4" upper="5" effort="9" velocity="9"'
    with caplog.at_level(logging.WARNING):
        robot = Robot.load(write(pair(1.0, limits)))
    assert robot.position_limits()[1][0] == 3.0
    reported = (
        "... joint 'follower': ... 'leader' ... 3.9 to 4.9 ... -3 to 3 ... ignored"
    )
    assert re.search(wording(reported), caplog.text)


def test_a_follower_brakes_its_leader(write: Write) -> None:
    """By m² times its damping and by m times its dry friction."""
    dynamics = '<dynamics damping="0.2" friction="0.3"/>'
    robot = Robot.load(write(pair(-2.0, dynamics=dynamics)))
    friction = JointFriction.of_model(robot)
    np.testing.assert_allclose(friction.viscous, [0.8, 0.0])
    np.testing.assert_allclose(friction.coulomb, [0.6, 0.0])


def test_a_chain_is_bounded_by_all_of_it(write: Write) -> None:
    text = TEXTS["chain of mimics"].replace(
        '<mimic joint="finger"', '<dynamics damping="1"/><mimic joint="finger"'
    )
    robot = Robot.load(write(text))
    assert robot.joint_names == ("shoulder", "elbow", "wrist", "tool")
    lower, upper = robot.position_limits()
    # finger = 0.9 · 0.8 · wrist + 0.1 and so on, each within ±3
    np.testing.assert_allclose([lower[2], upper[2]], [-3.0, 3.0])
    np.testing.assert_allclose(robot.model.effortLimit[2], 9.0 * 0.36)
    np.testing.assert_allclose(robot.model.damping[2], 0.36**2)


def test_a_leader_that_comes_late_keeps_its_name(write: Write) -> None:
    """q is its angle; limits and frame are its own."""
    path = write(TEXTS["follower first"])
    robot, free = Robot.load(path), Robot.load(path, mimic=False)
    assert robot.joint_names == ("shoulder", "elbow", "wrist")
    assert robot.dof_names == robot.joint_names

    def at(q: Array) -> None:
        one = robot.state(0.0, q, np.zeros(3))
        whole = np.array([0.7 * q[0] + 0.1, *q])
        other = free.state(0.0, whole, np.zeros(4))
        for frame in ("shoulder", "boom", "wrist"):
            np.testing.assert_allclose(
                one.position(frame), other.position(frame), rtol=0, atol=1e-12
            )

    at(robot.home())
    at(np.array([0.5, -1.0, 0.3]))
    locked = Robot.load(path, locked={"shoulder": 0.5})
    assert locked.joint_names == ("elbow", "wrist")
    q = np.array([-1.0, 0.3])
    np.testing.assert_allclose(
        locked.state(0.0, q, np.zeros(2)).position("link3"),
        free.state(0.0, np.array([0.45, 0.5, *q]), np.zeros(4)).position("link3"),
        rtol=0, atol=1e-12,
    )  # fmt: skip


@pytest.mark.parametrize("multiplier", [1.0, 2.5, -1.5, 0.0])
@pytest.mark.parametrize("kinds", [*itertools.product(TYPES, TYPES)])
def test_static_efforts_of_a_leader_include_its_followers(
    kinds: tuple[str, str], multiplier: float, write: Write
) -> None:
    """A limit on the follower: its bound holds, and its rows are G'' along the
    motion."""
    leader, follower = kinds
    path = write(
        chain(
            ("leader", leader, ""), ("middle", "revolute", ""),
            ("follower", follower, follow("leader", multiplier, 0.3)),
        )
    )  # fmt: skip
    robot, rng, none = Robot.load(path), np.random.default_rng(5), np.zeros(2)
    v, a = 0.5 * rng.standard_normal((2, 2))
    for _ in range(50):
        q = robot.integrate(robot.neutral(), rng.uniform(-1.0, 1.0, 2))
        gravity = np.abs(robot.inverse_dynamics(q, none, none))
        assert (gravity <= robot.largest_gravity * (1.0 + 1e-12)).all()
    effort, share, alpha, h = 0.5 * np.maximum(gravity, 1e-3), 0.9, 7.0, 1e-3
    limit = StaticEffort(effort, share)
    A, b = static_rows(limit, robot.state(0.0, q, v), alpha)
    assert len(A) == (gravity > 1e-3).sum()

    def room(s: float) -> Array:
        there = robot.integrate(q, s * v + 0.5 * s * s * a)
        return share - np.abs(robot.inverse_dynamics(there, none, none)) / effort

    rate = (room(h) - room(-h)) / (2.0 * h)
    second = (room(h) - 2.0 * room(0.0) + room(-h)) / h**2
    barrier = second + 2.0 * alpha * rate + alpha**2 * room(0.0)
    # Second differences of numbers near 2: rounding and truncation.
    expected = barrier[gravity > 1e-3]
    np.testing.assert_allclose(A @ a - b, expected, rtol=0.0, atol=1e-3)
