"""The configurations of configs/limits: the null space deviates, then the hand."""

from functools import cache

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control import Limits, Rollout, load_experiment
from hsp_control.control.actuation import Status

EVERY_STEP = "simulation.log_period=0.001"
EVERY_FIFTH = "simulation.log_period=0.005"  # a row costs as much as ten steps
UNLIMITED = "limits=null"
SHORTER = "simulation.duration=3.2"  # of the one at half strength
FREE = "simulation.duration=5"  # until the other one is beyond its joint limits


@cache
def run(name: str, *overrides: str) -> tuple[Rollout, Limits | None]:
    rows = EVERY_STEP if "half" in name else EVERY_FIFTH
    experiment = load_experiment(f"limits/{name}", rows, *overrides)
    return experiment.run(), experiment.controller.limits


def check_limits(rollout: Rollout, limits: Limits | None) -> None:
    """No limit is exceeded in any row of the log."""
    assert limits is not None
    assert rollout.meta["status"] == "completed"
    q, v, tau = rollout["q"], rollout["v"], rollout["tau"]
    assert (np.abs(tau) <= limits.effort + 1e-9).all()
    most = np.diff(rollout.t)[:, None] * limits.effort_rate
    assert (np.abs(np.diff(tau, axis=0)) <= most + 1e-9).all()
    assert (np.abs(v) <= limits.velocity).all()
    assert ((limits.lower <= q) & (q <= limits.upper)).all()
    assert rollout["status"].max() == Status.LIMITED


def error(rollout: Rollout) -> np.ndarray:
    """Return how far the hand is off its path [m]."""
    return np.linalg.norm(rollout["task.hand.error"], axis=1)


def test_half_strength() -> None:
    """No effort above half of its limit; the null space deviates, and the hand
    slightly."""
    ours, limits = run("panda_half_strength", SHORTER)
    free, _ = run("panda_half_strength", UNLIMITED, SHORTER)
    check_limits(ours, limits)
    assert limits is not None
    assert (np.abs(free["tau"]) / limits.effort).max() > 1.05  # it is commanded
    assert error(ours).max() < 3e-3
    limited = ours["status"] == Status.LIMITED
    first = int(np.flatnonzero(limited)[0])
    soon = slice(first, first + 60)
    assert np.abs(error(ours)[soon] - error(free)[soon]).max() < 1e-5
    assert ours["null_space_norm"][soon].max() > 0.3
    assert free["null_space_norm"][soon].max() < 0.03


def test_towards_a_joint_limit() -> None:
    """At the first stop the null space deviates, at the second the hand, too."""
    ours, limits = run("panda_towards_limit")
    free, _ = run("panda_towards_limit", UNLIMITED, FREE)
    check_limits(ours, limits)
    assert limits is not None
    assert free["q"][:, 3].max() > limits.upper[3] + 0.5
    assert ours["q"][:, 3].max() > limits.upper[3] - 0.006  # up to the margin
    first, second, home = (np.searchsorted(ours.t, t) for t in (2.9, 4.9, 7.9))
    # Deviation from strict priority at a weight of 1e-3; its cause is below.
    assert error(ours)[first] < 5e-4
    assert ours["null_space_norm"][first] > 1.0
    assert 5e-3 < error(ours)[second] < 0.05
    waiting = (ours.t > 4.75) & (ours.t < 5.0)
    assert np.abs(ours["v"][waiting]).max() < 0.1  # at rest beyond its reach
    assert error(ours)[home] < 1e-5  # and everything recovers on the way back
    assert ours["null_space_norm"][home] < 1e-3
    assert ours["status"][home] == 0


@pytest.mark.parametrize("name", ["panda_half_strength", "panda_towards_limit"])
def test_the_law_until_a_limit_is_met(name: str) -> None:
    """Before the first limited step both runs are identical."""
    half = "half" in name
    ours, _ = run(name, *([SHORTER] if half else []))
    free, _ = run(name, UNLIMITED, SHORTER if half else FREE)
    first = int(np.flatnonzero(ours["status"])[0])
    assert ours.t[first] > 0.5
    np.testing.assert_allclose(ours.tau[:first], free.tau[:first], rtol=0, atol=1e-9)


def test_efforts_do_not_swing_where_a_target_jumps() -> None:
    """A step of 25 cm: the null space does not deviate for the last bit of a task.

    If its cost were that without an error, efforts would change by 32 N·m in 2 ms.
    """
    robot = hsp.Robot.load("panda")
    home, period = robot.home(), 0.002
    start = robot.state(0.0, home, np.zeros(7)).position("panda_tcp").copy()
    target = hsp.Hold(start - np.array([0.0, 0.0, 0.25]))
    gains = hsp.Gains(natural_frequency=20.0)
    hand = hsp.FramePosition("panda_tcp", target, gains=gains, name="hand")
    run = hsp.simulate(
        hsp.Controller(robot, [hand], hsp.TargetPosture(home)),
        home,
        duration=0.6,
        control_period=period,
        log_period=period,
        integrator=hsp.integrators.Rk4(period),
    )
    assert (run["status"] == 2.0).sum() > 50
    assert np.abs(np.diff(run.tau, axis=0)).max() < 6.0
    error = np.linalg.norm(run["task.hand.error"], axis=1)
    assert error[run.t > 0.4].max() < 0.02 * error[0]
