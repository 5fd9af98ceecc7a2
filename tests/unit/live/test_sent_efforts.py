"""Efforts that may be in force: the sent ones and, for a while, the robot's own."""

import numpy as np
import pytest
from live_rigs import PERIOD, start, watched
from loaded_robots import panda

from hsp_control.live import LiveSettings, Phase
from hsp_control.live.effort_limiter import EffortLimiter
from hsp_control.live.sent_efforts import SentEfforts


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_its_own_effort_lasts_five_answers_and_then_fades(sign: float) -> None:
    """Zero effort although ±10 is sent: at first brakes or a load hold the joint."""
    sent = SentEfforts(np.array([5.0]), 4)
    held, has = np.array([-10.0 * sign]), np.array([0.0])
    sent.restart(held)
    for _ in range(5):
        sent.add(held)
        least, most, spare = sent.bounds_of(has)
        assert (least, most) == (min(held, has), max(held, has))
        assert spare == 0.5
    for k in range(1, 20):  # the excess decays by a hundredth
        bounds = sent.bounds_of(has)
        assert bounds[2] == 0.05
        has = bounds[1] if sign > 0.0 else bounds[0]
        assert has[0] == pytest.approx(sign * (-10.0 + 10.0 * 0.99**k), abs=1e-12)
    sent.bounds_of(held)
    least, most, _ = sent.bounds_of(np.array([0.0]))
    assert least == most == held


@pytest.mark.parametrize(("missing", "watchdog"), [(1, 30), (30, 1)])
def test_a_robot_may_have_an_old_effort_for_as_long_as_its_watchdog_waits(
    missing: int, watchdog: int
) -> None:
    """Or as long as the loop waits for a state."""
    settings = LiveSettings(missing=missing, watchdog=watchdog, effort_rate=1e9)
    limiter, q = EffortLimiter(panda(), settings, PERIOD), start()
    limiter.reset(q)
    gravity = limiter.sent.copy()
    for _ in range(10):  # its start-up is over
        assert limiter.contradiction(limiter.sent, halted=False) is None
        limiter.apply(gravity, q)
    limiter.apply(gravity + 5.0, q)
    old = limiter.sent.copy()
    for _ in range(30):
        limiter.apply(gravity, q)
        assert limiter.contradiction(old, halted=False) is None


def test_a_halted_robot_may_have_the_effort_of_its_own_stop() -> None:
    """1.5 times its limits, less the gravity that it compensates itself."""
    settings = LiveSettings(compensates_gravity=True)
    limiter, q = EffortLimiter(panda(), settings, PERIOD), start()
    limiter.reset(q)
    i = int(np.abs(limiter.gravity).argmax())
    assert abs(limiter.gravity[i]) > 10.0
    for sign in (1.0, -1.0):
        has = np.zeros(7)
        has[i] = sign * 1.5 * limiter.effort_limits[i] - limiter.gravity[i]
        assert limiter.contradiction(has * (1.0 - 1e-9), halted=True) is None
        has[i] += sign
        assert limiter.contradiction(has, halted=True) is not None


def test_a_robot_waits_for_its_first_effort_without_an_end() -> None:
    robot = watched(LiveSettings(watchdog=10))
    for _ in range(100):
        robot.advance([])
    assert robot.phase == Phase.WAITING
    robot.advance([robot.tau])
    assert robot.phase == Phase.RUNNING


@pytest.mark.parametrize(("reports", "held"), [(True, 6), (False, 1)])
def test_after_a_lost_state_an_effort_is_near_the_one_before_it_too(
    reports: bool, held: int
) -> None:
    """The last effort may be lost; after five lost states efforts may still arrive."""
    settings = LiveSettings(effort_rate=1000.0)
    limiter, q = EffortLimiter(panda(), settings, PERIOD), start()
    limiter.reset(q)
    before = limiter.sent.copy()
    limiter.robot_has(before if reports else None)
    steps = []
    for _ in range(held + 3):
        limiter.apply(before + 100.0, q)
        steps.append((limiter.sent - before)[3])  # of 1 N·m
        limiter.no_measurement()
    np.testing.assert_allclose(steps, [1.0] * held + [2.0, 3.0, 4.0], atol=1e-9)


def test_a_reset_forgets_that_a_robot_reports_its_efforts() -> None:
    slow = LiveSettings(effort_rate=100.0)
    new, used = (EffortLimiter(panda(), slow, PERIOD) for _ in range(2))
    used.reset(start())
    used.robot_has(used.sent + 0.1)
    for limiter in (new, used):
        limiter.reset(start())
        for _ in range(2):
            limiter.apply(limiter.effort_limits, start())
            limiter.no_measurement()
    np.testing.assert_array_equal(used.sent, new.sent)
