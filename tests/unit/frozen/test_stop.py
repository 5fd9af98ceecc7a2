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
from hsp_control.frozen.braking import StopGains
from hsp_control.live.safe_stop import SafeStop
from hsp_control.live.settings import StopSettings

H = 0.001


@pytest.fixture(scope="module")
def frozen(tmp_path_factory: pytest.TempPathFactory) -> Path:
    controller = hsp.load_experiment("panda_limits").controller
    return hsp.freeze(controller, tmp_path_factory.mktemp("frozen") / "panda.hsp")


@pytest.fixture
def opened(frozen: Path) -> Opened:
    return Opened(frozen)


def test_its_gains_are_those_of_a_live_loop() -> None:
    live = StopSettings()
    for name, value in StopGains()._asdict().items():
        assert getattr(live, name) == value


@pytest.mark.smoke
@pytest.mark.parametrize("payload", [0.0, 2.0])
def test_it_brakes_and_holds(payload: float, opened: Opened) -> None:
    experiment = hsp.load_experiment("panda_limits")
    controller, robot = experiment.controller.preview(), experiment.robot
    q = experiment.q0.copy()
    rng = np.random.default_rng(61)
    v = rng.normal(0.0, 1.0, 7)  # so fast that the efforts' limits bind
    controller.compute(0.0, q, v)
    assert opened.step(0.0, q, v) >= OK
    if payload:
        controller.at(0.0).ramp(0.0).payload("panda_tcp", payload, (0.0, 0.0, 0.1))
        body = [payload, 0.0, 0.0, 0.1, *np.zeros(6)]
        assert opened.set("panda_tcp.payload", body) == OK
    controller.compute(H, q, v)  # the model is that of this time
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
        # BLAS and Eigen sum in different orders
        np.testing.assert_allclose(opened.tau, tau, rtol=0.0, atol=1e-10)
        assert (np.abs(tau) <= limits + 1e-9).all()
        a = robot.forward_dynamics(q, v, tau, dynamics)
        v = v + H * a
        q = robot.integrate(q, H * v)
    assert sorted(phases) == phases  # it brakes, and then it holds
    assert {*phases} == {BRAKING, HOLDING}
    assert np.abs(v).max() < 1e-4


def test_after_a_refused_step_it_brakes_whatever_the_clock_says(opened: Opened) -> None:
    q, v = hsp.load_experiment("panda_limits").q0, 0.1 * np.ones(7)
    assert opened.step(5.0, q, v) >= OK
    last = opened.tau.copy()
    assert opened.step(4.0, q, v) == WRONG_CLOCK
    np.testing.assert_array_equal(opened.tau, last)
    assert opened.stop(4.0, np.nan * q, v) == WRONG_STATE  # nothing is known
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


def test_it_can_be_the_first_that_is_asked(opened: Opened) -> None:
    q = hsp.load_experiment("panda_limits").q0
    assert opened.stop(100.0, q, np.zeros(7)) == HOLDING
    rest = hsp.Robot.load("panda").inverse_dynamics(q, np.zeros(7), np.zeros(7))
    np.testing.assert_array_equal(opened.tau, rest)
