"""Causes of a change of momentum: efforts, bounded contacts, or a sensor fault."""

import numpy as np
import pytest
from live_rigs import PERIOD
from loaded_robots import panda

from hsp_control.common.arrays import Array
from hsp_control.live import LiveSettings
from hsp_control.live.momentum_check import Driving, MomentumCheck, smaller

SETTINGS = LiveSettings()
LIMITS = np.full(7, 100.0)
"""Effort limits [N·m]; friction may thus be 10 N·m, and contacts 30 N·m."""
INERTIA = np.diag([2.0, 2.0, 2.0, 2.0, 0.5, 0.5, 0.5])
ZERO = np.zeros(7)
ONE = np.eye(7)[0]


def check() -> MomentumCheck:
    return MomentumCheck(panda(), SETTINGS, LIMITS, PERIOD)


def pushed(force: float, *, follows: float = 1.0, seconds: float = 0.3) -> Array:
    """Return the joints reported while an external effort acts on the first one.

    The effort is ±20 N·m; the joint follows a fraction of it, and all of the push.
    """
    momentum, v = check(), np.zeros(7)
    found = np.zeros(7, dtype=bool)
    for k in range(round(seconds / PERIOD)):
        effort = 20.0 * np.sin(10.0 * k * PERIOD) * ONE
        acts = force if k > 100 else 0.0
        v = v + PERIOD * (follows * effort + acts * ONE) / np.diag(INERTIA)
        both = np.stack([v, v])
        momentum.update(both, both, Driving(INERTIA, effort, ZERO), PERIOD)
        found |= momentum.beyond
    return found


def test_contacts_and_friction_may_push_by_their_bounds() -> None:
    """40 N·m; noise of 0.3 rad/s in 50 ms adds 12 N·m."""
    assert not pushed(35.0).any()
    assert not pushed(-35.0).any()
    assert pushed(60.0).tolist() == [True] + 6 * [False]
    assert pushed(-90.0)[0]  # against its effort; it may follow by less than the effort


def test_a_joint_may_be_heavier_than_its_model() -> None:
    for follows in (0.1, 0.5, 1.0):
        assert not pushed(0.0, follows=follows).any(), follows


def jump(size: float, *, of_v: bool = True, of_q: bool = True) -> MomentumCheck:
    momentum = check()
    for k in range(120):
        jumped = size * (k >= 100)
        now = np.stack([jumped * of_v * ONE, jumped * of_q * ONE])
        momentum.update(now, np.zeros((2, 7)), Driving(INERTIA, ZERO, ZERO), PERIOD)
        if momentum.beyond.any():
            assert k <= 102  # soon
            return momentum
    return momentum


def test_a_jump_of_velocity_and_slope_is_found_at_once() -> None:
    assert jump(1.0).beyond[0]
    assert jump(-1.0).beyond[0]
    assert jump(1.0).rest[0] > 100.0  # N·m, over 3 ms
    assert jump(-1.0).rest[0] < -100.0
    assert not jump(0.3).beyond.any()  # noise
    assert not jump(1.0, of_q=False).beyond.any()  # for another check
    assert not jump(1.0, of_v=False).beyond.any()


def test_a_gap_without_states_is_no_jump() -> None:
    momentum = check()
    for k in range(200):
        v = (1.0 if k >= 100 else 0.0) * np.ones((2, 7))
        passed = 0.09 if k == 100 else PERIOD
        momentum.update(v, v, Driving(INERTIA, ZERO, ZERO), passed)
        assert not momentum.beyond.any(), k


def test_where_no_effort_limit_is_known_anything_may_push() -> None:
    momentum = MomentumCheck(panda(), SETTINGS, np.full(7, np.inf), PERIOD)
    for k in range(100):
        v = 5.0 * (k % 2) * np.ones((2, 7))
        momentum.update(v, v, Driving(INERTIA, ZERO, ZERO), PERIOD)
        assert not momentum.beyond.any()


def test_the_smaller_of_two_velocities_drives_no_joint() -> None:
    a, b = np.array([1.0, -0.2, 0.5, -1.0]), np.array([0.3, -0.9, -0.5, 0.0])
    assert smaller(a, b).tolist() == [0.3, -0.2, 0.0, 0.0]


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_heavier_joint_follows_a_steady_effort_by_less(sign: float) -> None:
    """Its momentum is between 0 and the impulse, for any impulse."""
    momentum, v = check(), np.zeros(7)
    for k in range(300):
        effort = sign * 300.0 * ONE * (k > 100)
        v = v + PERIOD * 0.3 * effort / np.diag(INERTIA)
        both = np.stack([v, v])
        momentum.update(both, both, Driving(INERTIA, effort, ZERO), PERIOD)
        assert not momentum.beyond.any(), k


def test_efforts_before_a_gap_explain_no_motion_after_it() -> None:
    momentum, v = check(), np.zeros(7)
    for k in range(300):
        effort = (100.0 if k < 100 else 0.0) * ONE
        v = v + PERIOD * effort / np.diag(INERTIA)
        both = np.stack([v, v])
        passed = 0.09 if k == 100 else PERIOD
        momentum.update(both, both, Driving(INERTIA, effort, ZERO), passed)
        assert not momentum.beyond.any(), k
