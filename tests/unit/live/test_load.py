"""The load that a safe stop compensates: its estimate, and the effect of a fault on
it."""

import numpy as np
import pinocchio as pin
import pytest
from live_rigs import PERIOD, Rig, law, panda, start

import hsp_control as hsp
from hsp_control.common.arrays import Array, Flags
from hsp_control.live import InProcessRobot, SimulatedRobot, loop, run_loop
from hsp_control.live.safe_stop import SafeStop
from hsp_control.live.settings import StopSettings
from hsp_control.robot import RobotState

LIMITS = np.full(7, 100.0)
"""Effort limits [N·m]; a load may thus be 30 N·m."""
RATE, BEFORE, AHEAD = 3.0, 0.2, 0.05
"""Rate of the estimate [1/s], its age when it is used [s], and its lead [s]."""
LOAD = np.array([0.0, 4.0, -1.0, -5.0, 0.2, -2.0, 0.1])
ZERO = np.zeros(7)
NONE = np.zeros(7, dtype=bool)


def stop(limits: Array = LIMITS) -> SafeStop:
    return SafeStop(panda(), StopSettings(), limits, PERIOD)


def observe(
    safe: SafeStop,
    load: Array,
    states: int,
    v: Array = ZERO,
    begin: int = 0,
    silent: Flags = NONE,
) -> None:
    """Feed states at one posture, held by efforts and a load."""
    state = panda().state(0.0, start(), v)
    for k in range(begin, begin + states):
        state.update(k * PERIOD, start(), v)
        safe.observe(state, state.nonlinear_effects - load, silent)


def test_a_load_is_found_by_a_mean_then_by_a_low_pass_and_used_later() -> None:
    safe = stop()
    late, mean = round(BEFORE / PERIOD), int((1.0 / RATE - AHEAD) / PERIOD)
    observe(safe, LOAD, late)
    np.testing.assert_array_equal(safe.load, 0.0)
    observe(safe, LOAD, mean + 1, begin=late)
    found = mean * PERIOD / (mean * PERIOD + AHEAD)
    np.testing.assert_allclose(safe.load, found * LOAD, rtol=1e-9, atol=1e-12)
    assert found > 0.8
    observe(safe, LOAD, 500, begin=late + mean + 1)
    found = 1.0 - (1.0 - found) * (1.0 - RATE * PERIOD) ** 500
    np.testing.assert_allclose(safe.load, found * LOAD, rtol=1e-9, atol=1e-12)


def test_a_wrong_first_velocity_moves_a_braked_joint_no_faster_than_itself() -> None:
    """The gain is at most k = 1/T₀, so an error x causes at most k M x."""
    safe, wrong = stop(np.full(7, 1e4)), 0.3 * np.eye(7)[1]
    observe(safe, ZERO, 1)
    observe(safe, ZERO, 1 + round(BEFORE / PERIOD), v=wrong, begin=1)
    momentum = panda().state(0.0, start(), ZERO).mass_matrix @ wrong
    gain = 1.0 / (AHEAD + PERIOD)
    np.testing.assert_allclose(safe.load, gain * momentum, rtol=1e-9, atol=1e-9)
    assert gain < StopSettings().damping


def test_a_load_is_bounded_by_that_of_a_contact() -> None:
    for sign in (1.0, -1.0):
        safe = stop()
        observe(safe, sign * 1000.0 * np.ones(7), 1000)
        np.testing.assert_array_equal(safe.load, sign * 0.3 * LIMITS)
    unknown = stop(np.full(7, np.inf))  # no scale is known there
    observe(unknown, LOAD, 1000)
    np.testing.assert_array_equal(unknown.load, 0.0)


def test_a_wrong_velocity_leaves_a_bounded_load() -> None:
    """An error x is an impulse M x and causes at most K M x: K x/k in the stop."""
    safe, wrong = stop(), 0.5 * np.eye(7)[3]
    observe(safe, ZERO, 300)
    momentum = panda().state(0.0, start(), ZERO).mass_matrix @ wrong
    late = round(BEFORE / PERIOD)
    observe(safe, ZERO, late, v=wrong, begin=300)
    np.testing.assert_allclose(safe.load, 0.0, atol=1e-12)
    observe(safe, ZERO, 1, v=wrong, begin=300 + late)
    np.testing.assert_allclose(safe.load, RATE * momentum, rtol=1e-9, atol=1e-12)
    observe(safe, ZERO, 1000, v=wrong, begin=301 + late)
    assert (np.abs(safe.load) < 0.1 * RATE * np.abs(momentum).max()).all()


def test_the_effect_of_a_dead_sensor_is_no_load() -> None:
    """The joint appears to be held against the effort that accelerates it."""
    safe, silent = stop(), NONE.copy()
    silent[3] = True
    observe(safe, LOAD, 1000)
    observe(safe, LOAD - 20.0 * np.eye(7)[3], 1000, begin=1000, silent=silent)
    found = (1.0 - (1.0 - RATE * PERIOD) ** 1000) * LOAD
    for dead in (NONE, silent):
        safe.trust(measurements=False, dead=dead)
        held = np.abs(safe.load - found) < 0.1 * np.abs(LOAD) + 1e-9
        assert held.tolist() == (dead | (np.arange(7) != 3)).tolist()


def test_nothing_is_learnt_across_a_gap() -> None:
    safe = stop()
    observe(safe, ZERO, 10)
    observe(safe, ZERO, 300, v=np.ones(7), begin=40)  # 30 periods later
    np.testing.assert_allclose(safe.load, 0.0, atol=1e-12)


def test_a_new_run_forgets_the_load_and_a_stop_keeps_it() -> None:
    safe = stop()
    observe(safe, LOAD, 1000)
    before = safe.load.copy()
    safe.begin()
    state = panda().state(1.0, start(), ZERO)
    tau = safe.effort(state)
    np.testing.assert_array_equal(safe.load, before)
    np.testing.assert_allclose(tau, state.nonlinear_effects - before, rtol=1e-12)
    safe.restart()
    np.testing.assert_array_equal(safe.load, 0.0)
    np.testing.assert_allclose(safe.effort(state), state.nonlinear_effects)


@pytest.mark.parametrize("observed", [False, True])
def test_an_arm_with_an_unknown_load_does_not_sink(observed: bool) -> None:
    """At rest; without the load estimated before the stop it sinks."""
    model = panda().model.copy()
    hand = model.frames[model.getFrameId("panda_tcp")]
    load = pin.Inertia(1.0, np.zeros(3), 1e-3 * np.eye(3))
    model.appendBodyToJoint(hand.parentJoint, load, hand.placement)
    loaded = hsp.Robot.from_pinocchio(model)
    q, v, safe = start(), np.zeros(7), stop()
    state = panda().state(0.0, q, v)
    if observed:
        held = loaded.inverse_dynamics(q, v, v)
        observe(safe, state.nonlinear_effects - held, 1500)
    safe.begin()
    fastest = 0.0
    for k in range(500):
        tau = safe.effort(state.update(2.0 + k * PERIOD, q, v))
        v = v + PERIOD * loaded.forward_dynamics(q, v, tau)
        q = loaded.integrate(q, PERIOD * v)
        fastest = max(fastest, float(np.abs(v).max()))
    assert (fastest < 0.02) == observed, fastest
    assert (fastest > 0.1) != observed, fastest


def test_a_stop_early_in_a_run_still_learns_the_load() -> None:
    """Masses wrong by 20 % per link; with a frozen estimate its residual moved the
    arm."""
    robot = hsp.Robot.load("ur5")
    model, rng = robot.model.copy(), np.random.default_rng(2)
    for k in range(1, model.njoints):
        body, share = model.inertias[k], rng.choice([0.8, 1.2])
        model.inertias[k] = pin.Inertia(
            share * body.mass, body.lever, share * body.inertia
        )
    plant = hsp.plants.RigidBodyPlant(hsp.Robot.from_pinocchio(model))
    moving = hsp.plants.IntegratedPlant(plant, hsp.integrators.Rk4(PERIOD))
    simulated = SimulatedRobot(moving, robot.home(), np.zeros(robot.nv), PERIOD)
    circle = hsp.Circle(radius=0.05, angular_rate=2.0)
    hand = hsp.FramePosition(robot.end_effector, circle, blend=0.2)
    report = hsp.run_loop(
        hsp.Controller(robot, [hand], hsp.JointCentering(), null_space_gain=8.0),
        InProcessRobot(simulated),
        duration=0.3,
        clock=lambda: simulated.t,
    )
    assert (report.ended, report.at_rest) == ("completed", True), report.reason


def test_a_load_is_learned_in_the_run_not_in_its_rehearsal(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    learned: list[str] = []

    class Watched(SafeStop):
        def observe(self, state: RobotState, acts: Array, silent: Flags) -> None:
            learned.append("observed")
            super().observe(state, acts, silent)

        def restart(self) -> None:
            learned.append("forgotten")
            super().restart()

    monkeypatch.setattr(loop, "SafeStop", Watched)
    rig = Rig()
    run_loop(law(), rig, duration=0.01)
    rehearsed = learned.index("forgotten")
    assert 0 < rehearsed < rig.reads
    assert learned.count("observed") - rehearsed == len(rig.sent)
