"""The checks of one joint's sensors, fed by hand: where each of them stops to judge."""

import numpy as np
import pytest
from live_rigs import PERIOD
from loaded_robots import panda

from hsp_control.common.arrays import Array, Flags
from hsp_control.live import LiveSettings
from hsp_control.live.reaction_check import ReactionCheck
from hsp_control.live.velocity_check import VelocityCheck

SETTINGS = LiveSettings()


def stopped(joints: list[int], speed: float) -> Flags:
    """Return which sensors are dead after some joints stop in one period."""
    check = VelocityCheck(panda(), SETTINGS, PERIOD)
    v = np.zeros(7)
    v[joints] = speed
    for k in range(150):
        now = v if k < 50 else np.zeros(7)
        check.update(now * PERIOD, now, PERIOD)
    return check.dead


def test_friction_stops_one_slow_joint_in_a_period_and_not_several() -> None:
    """At 50 rad/s² and in two periods: 0.1 rad/s, less where more of them stop."""
    assert not stopped([0], 0.06).any()
    assert not stopped([0, 1], 0.04).any()
    assert stopped([0, 1], 0.06).tolist() == [True, True] + 5 * [False]
    assert stopped([0], 0.11).tolist() == [True] + 6 * [False]


@pytest.mark.parametrize(("missing", "doubtful"), [(2, True), (4, False)])
def test_a_slope_across_a_gap_is_not_compared_with_the_velocity_after_it(
    missing: int, doubtful: bool
) -> None:
    """The joint accelerated meanwhile: its slope is half of its velocity."""
    check, found = VelocityCheck(panda(), SETTINGS, PERIOD), False
    v = np.ones(7)
    for k in range(300):
        passed = (missing if k == 100 else 1) * PERIOD
        speed, slope = (0.0, 0.0) if k < 100 else (1.0, 0.5 if k == 100 else 1.0)
        check.update(slope * v * passed, speed * v, passed)
        found |= bool(check.doubtful.any())
        assert not check.contradicted.any(), k
    assert found == doubtful


def felt(share: float) -> bool:
    """Return whether another joint's motion shows that a silent one moves."""
    inertia = np.array([[1.0, 0.5], [0.5, 1.0]])
    free: Array = np.linalg.solve(inertia, [1.0, 0.0])  # an effort on the first one
    check = ReactionCheck(SETTINGS.velocity_error)
    for k in range(300):
        check.expect(np.array([True, False]), inertia, free)
        check.update(share * k * PERIOD * free, PERIOD)
    return check.felt


def test_what_moves_by_much_more_than_the_reaction_moves_for_another_reason() -> None:
    assert [felt(share) for share in (0.3, 1.0, 2.0)] == [False, True, False]
