"""``hsp_stop`` brakes a robot and holds it, as a live loop does."""

from pathlib import Path

import numpy as np
import pytest
from frozen_library import (
    BRAKING,
    HOLDING,
    LIB,
    OK,
    STOPPED,
    WRONG_CLOCK,
    WRONG_STATE,
    Opened,
)

import hsp_control as hsp
from hsp_control.common.errors import FreezeError
from hsp_control.frozen.braking import StopGains
from hsp_control.live import LiveSettings
from hsp_control.live.safe_stop import SafeStop
from hsp_control.live.settings import StopSettings

H = 0.001


@pytest.fixture(scope="module")
def frozen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    controller = hsp.load_experiment("panda_limits").controller
    return hsp.freeze(controller, tmp_path_factory.mktemp("frozen") / "panda.hsp")


def test_its_gains_are_those_of_a_live_loop() -> None:
    live = StopSettings()
    for name, value in StopGains()._asdict().items():
        assert getattr(live, name) == value


def test_gains_that_are_too_fast_for_the_period_are_refused(tmp_path: Path) -> None:
    controller = hsp.load_experiment("panda_limits").controller
    for gains, message in {
        StopGains(damping=600.0): "stop.damping is 600; at a period of 0.001 s it may",
        StopGains(natural_frequency=201.0): "stop.natural_frequency is 201; .* 200 at",
    }.items():
        with pytest.raises(FreezeError, match=message):
            hsp.freeze(controller, tmp_path / "panda.hsp", stop=gains)


@pytest.mark.smoke
@pytest.mark.parametrize("payload", [0.0, 2.0])
def test_it_brakes_and_holds(payload: float, opened: Opened) -> None:
    experiment = hsp.load_experiment("panda_limits")
    controller, robot = experiment.controller.preview(), experiment.robot
    q = experiment.q0.copy()
    rng = np.random.default_rng(61)
    v = rng.normal(0.0, 1.0, 7)  # so fast that effort limits are active
    controller.compute(0.0, q, v)
    assert opened.step(0.0, q, v) >= OK
    if payload:
        controller.at(0.0).ramp(0.0).payload("panda_tcp", payload, (0.0, 0.0, 0.1))
        body = [payload, 0.0, 0.0, 0.1, *np.zeros(6)]
        assert opened.set("panda_tcp.payload", body) == OK
    controller.compute(H, q, v)  # the model of this time
    dynamics = controller.state.dynamics
    state = hsp.RobotState(robot, dynamics)
    assert controller.limits is not None
    limits = np.array(controller.limits.effort)
    expected = SafeStop(robot, StopSettings(), limits, H)
    phases = []
    for k in range(1, 1500):
        state.update(k * H, q, v)
        tau = expected.effort(state)
        phases.append(opened.stop(k * H, q, v))
        np.testing.assert_array_equal(opened.tau, tau)
        assert (np.abs(tau) <= limits + 1e-9).all()
        a = robot.forward_dynamics(q, v, tau, dynamics)
        v = v + H * a
        q = robot.integrate(q, H * v)
    assert sorted(phases) == phases  # brakes, then holds
    assert {*phases} == {BRAKING, HOLDING}
    assert np.abs(v).max() < 1e-4


def test_it_goes_on_with_the_load_that_the_steps_showed(opened: Opened) -> None:
    """The robot stands on the law's efforts, which already carry the payload."""
    experiment = hsp.load_experiment("panda_limits")
    assert experiment.controller.limits is not None
    limits = np.array(experiment.controller.limits.effort)
    expected = SafeStop(experiment.robot, StopSettings(), limits, H)
    q, v = experiment.q0, np.zeros(7)
    state = hsp.RobotState(experiment.robot)
    for k in range(600):
        assert opened.step(k * H, q, v) >= OK
        expected.observe(state.update(k * H, q, v), opened.tau, np.zeros(7, bool))
    np.testing.assert_array_equal(opened.get("stop.load", 7), expected.load)
    assert np.abs(expected.load).max() > 0.1
    for k in range(600, 900):
        opened.stop(k * H, q, v)
        np.testing.assert_array_equal(opened.tau, expected.effort(state))
    assert LIB.hsp_restart(opened.handle) == OK
    np.testing.assert_array_equal(opened.get("stop.load", 7), 0.0)


def test_joints_without_ends_are_held_too(tmp_path: Path) -> None:
    experiment = hsp.load_experiment("tiago_reach")
    controller, robot = experiment.controller, experiment.robot
    assert not robot.linear
    opened = Opened(hsp.freeze(controller, tmp_path / "tiago.hsp"))
    limits = LiveSettings().effort_limits(robot, controller.limits)
    expected = SafeStop(robot, StopSettings(), limits, H)
    state, q = hsp.RobotState(robot), experiment.q0
    v = 0.3 * np.random.default_rng(61).normal(size=robot.nv)
    assert opened.step(0.0, q, v) >= OK
    phases = []
    for k in range(1, 1000):
        phases.append(opened.stop(k * H, q, v))
        tau = expected.effort(state.update(k * H, q, v))
        np.testing.assert_array_equal(opened.tau, tau)
        v = v + H * robot.forward_dynamics(q, v, tau)
        q = robot.integrate(q, H * v)
    assert {*phases} == {BRAKING, HOLDING}
    assert np.abs(v).max() < 1e-3


def test_after_a_refused_step_it_brakes_at_any_clock_time(opened: Opened) -> None:
    q, v = hsp.load_experiment("panda_limits").q0, 0.1 * np.ones(7)
    assert opened.step(5.0, q, v) >= OK
    last = opened.tau.copy()
    assert opened.step(4.0, q, v) == WRONG_CLOCK
    np.testing.assert_array_equal(opened.tau, last)
    assert opened.stop(4.0, np.nan * q, v) == WRONG_STATE  # no state
    np.testing.assert_array_equal(opened.tau, last)
    assert opened.stop(4.0, q, v) == BRAKING
    braked = opened.tau.copy()
    assert (braked != last).any()
    assert opened.step(4.001, q, v) == STOPPED
    np.testing.assert_array_equal(opened.tau, braked)
    assert "hsp_restart" in opened.error
    assert LIB.hsp_restart(opened.handle) == OK
    assert opened.step(0.0, q, v) >= OK
    np.testing.assert_array_equal(opened.tau, last)


def test_it_can_be_the_first_call(opened: Opened) -> None:
    q = hsp.load_experiment("panda_limits").q0
    assert opened.stop(100.0, q, np.zeros(7)) == HOLDING
    rest = hsp.Robot.load("panda").inverse_dynamics(q, np.zeros(7), np.zeros(7))
    np.testing.assert_array_equal(opened.tau, rest)


# -- without states -----------------------------------------------------------------

REPEATED = 5
"""Consecutive periods with the last effort, as in `hsp_step.h`."""


def test_a_dead_sensor_does_not_drive_the_arm(opened: Opened) -> None:
    """q becomes NaN permanently while the arm accelerates: it comes to rest."""
    experiment = hsp.load_experiment("panda_limits")
    robot, q = experiment.robot, experiment.q0.copy()
    v = np.linspace(-0.5, 0.5, 7)
    speeds = []
    for k in range(300):
        dead = k >= 50
        status = opened.step(H * k, np.nan * q if dead else q, v)
        assert status < 0 if dead else status >= OK
        if k == 50:
            last = opened.tau.copy()
        elif 50 < k < 50 + REPEATED:
            np.testing.assert_array_equal(opened.tau, last)
        v = v + H * robot.forward_dynamics(q, v, opened.tau)
        q = robot.integrate(q, H * v)
        speeds.append(np.abs(v).max())
    assert speeds[50] > 0.25
    # The expected velocity lacks the effect of the repeated efforts and the Coriolis
    # terms; that part is not braked.
    assert speeds[-1] < 0.15 * speeds[50]
    assert opened.step(0.3, q, v) == STOPPED  # the law returns only after a restart
    assert opened.stop(0.301, q, v) == BRAKING


def test_one_wrong_state_is_passed_over(opened: Opened) -> None:
    q, v = hsp.load_experiment("panda_limits").q0, np.zeros(7)
    assert opened.step(0.0, q, v) >= OK
    for k in range(1, 100):
        wrong = k % (REPEATED + 1) != 0
        status = opened.step(H * k, np.nan * q if wrong else q, v)
        assert status == WRONG_STATE if wrong else status >= OK


def test_steps_of_a_wrong_clock_end_in_the_stop(opened: Opened) -> None:
    q, v = hsp.load_experiment("panda_limits").q0, 0.1 * np.ones(7)
    assert opened.step(5.0, q, v) >= OK
    last = opened.tau.copy()
    for _ in range(REPEATED):
        assert opened.step(4.0, q, v) == WRONG_CLOCK
        np.testing.assert_array_equal(opened.tau, last)
    assert opened.step(4.0, q, v) == STOPPED
    braked = opened.tau.copy()
    assert opened.stop(4.001, q, v) == BRAKING
    np.testing.assert_array_equal(opened.tau, braked)


def test_a_stop_that_sees_again_holds_where_the_robot_is(opened: Opened) -> None:
    q, v = hsp.load_experiment("panda_limits").q0, np.zeros(7)
    robot = hsp.Robot.load("panda")
    assert opened.step(0.0, q, v) >= OK
    for k in range(1, 100):
        assert opened.stop(H * k, np.nan * q, v) == WRONG_STATE
    moved = q + 0.1
    assert opened.stop(0.1, moved, v) == HOLDING
    rest = robot.inverse_dynamics(moved, v, v)  # no pull to the expected position
    np.testing.assert_allclose(opened.tau, rest, rtol=0.0, atol=1e-12)
