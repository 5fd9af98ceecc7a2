"""Limits: the step is the law's where none is active, and within them elsewhere."""

from copy import deepcopy
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_robots import panda
from places import THOROUGH
from runs import held
from states import at_home

import hsp_control as hsp
from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import ObstacleDistance, RobotLimits, SelfDistance
from hsp_control.control.actuation import Status
from hsp_control.control.actuation.sent_effort import SentEffort, SentMemory
from hsp_control.control.compensation import Compensation, MomentumObserver
from hsp_control.simulation.plants import (
    EffortDelay,
    Friction,
    Inertias,
    Payload,
    Push,
    RigidBody,
    RigidBodyPlant,
    VelocityNoise,
)
from hsp_control.trajectories import Lissajous

seeds = st.integers(0, 2**32 - 1)


def hand(frequency: float = 10.0, **circle: Any) -> hsp.FramePosition:
    options = {"angular_rate": 2.0, "normal": [0.0, 0.0, 1.0], **circle}
    path = hsp.Circle(0.15, center=[0.45, 0.0, 0.45], **options)
    gains = hsp.Gains(natural_frequency=frequency)
    return hsp.FramePosition("panda_tcp", path, gains=gains, name="hand")


# --- the bounds ----------------------------------------------------------------------


def of(robot: hsp.Robot, **options: Any) -> RobotLimits:
    """Return limits as numbers of a robot."""
    return hsp.Limits(**options).placed(at_home(robot))


def bounds(
    limits: RobotLimits,
    q: Array,
    v: Array,
    error: float = 0.0,
    drift: float = 0.0,
    steady: float = 0.0,
    lasting: float | None = None,
) -> tuple[Array, Array]:
    a_lower, a_upper = np.zeros(7), np.zeros(7)
    lasting = drift if lasting is None else lasting
    least, most = np.full(7, min(drift, 0.0)), np.full(7, max(drift, 0.0))
    observed = {
        "error": np.full(7, error),
        "least": least,
        "most": most,
        "lasting": np.full(7, lasting),
        "steady": np.full(7, steady),
    }
    engine.AccelerationBounds(
        q=q,
        v=v,
        where=limits.robot.dof_indices,
        limits=limits.motion,
        held=observed,
        a_lower=a_lower,
        a_upper=a_upper,
    )()
    return a_lower, a_upper


def test_bounds_are_the_barriers() -> None:
    robot = panda()
    limits = of(robot, bandwidth=8.0, position_margin=0.0, velocity_margin=0.0)
    q, v = robot.home(), np.full(7, 0.1)
    a_lower, a_upper = bounds(limits, q, v)
    lower, upper = robot.position_limits()

    def towards(room: Array, gap: Array, v: Array) -> Array:
        speed = np.minimum(16.0 * gap, np.sqrt(limits.motion.jerk * gap))
        return np.minimum(64.0 * room - 16.0 * v, speed)

    expected = towards(upper - q, limits.velocity - v, v)
    np.testing.assert_allclose(a_upper, expected, rtol=1e-14)
    expected = -towards(q - lower, limits.velocity + v, -v)
    np.testing.assert_allclose(a_lower, expected, rtol=1e-14)


@given(seeds)
def test_position_bounds_are_the_barriers_of_both_limits(seed: int) -> None:
    """h'' + 2αh' + α²h ≥ 0 for the distance h to either limit, also beyond it."""
    robot, rng = panda(), np.random.default_rng(seed)
    limits = of(robot, velocity=None, position_margin=0.0, bandwidth=8.0)
    lower, upper = robot.position_limits()
    q = lower + (upper - lower) * rng.uniform(-0.1, 1.1, 7)
    v = rng.normal(0.0, 2.0, 7)
    a_lower, a_upper = bounds(limits, q, v)
    for a, h, side in ((a_lower, q - lower, 1.0), (a_upper, upper - q, -1.0)):
        barrier = side * a + 16.0 * side * v + 64.0 * h
        np.testing.assert_allclose(barrier, 0.0, rtol=0, atol=1e-11)


@given(seeds, st.floats(-9.0, 9.0))
def test_the_drift_is_made_up_for_where_it_leads_beyond_a_limit(
    seed: int, drift: float
) -> None:
    """The acceleration with the drift satisfies the barrier.

    A drift that has ended widens no bound; a present one widens that of the other side.
    """
    robot, rng = panda(), np.random.default_rng(seed)
    limits = of(robot, velocity=None)
    lower, upper = robot.position_limits()
    q, v = rng.uniform(lower, upper), rng.normal(0.0, 1.0, 7)
    plain, (a_lower, a_upper) = bounds(limits, q, v), bounds(limits, q, v, 0.0, drift)
    up, down = max(drift, 0.0), min(drift, 0.0)
    np.testing.assert_allclose(a_upper + up, plain[1], rtol=0, atol=1e-11)
    np.testing.assert_allclose(a_lower + down, plain[0], rtol=0, atol=1e-11)
    a_lower, a_upper = bounds(limits, q, v, 0.0, drift, drift)
    np.testing.assert_allclose(a_upper + drift, plain[1], rtol=0, atol=1e-11)
    np.testing.assert_allclose(a_lower + drift, plain[0], rtol=0, atol=1e-11)


def test_lasting_errors_are_compensated_within_a_light_joint_s_effort() -> None:
    """Past drift widens by at most a tenth of the range; present drift by more."""
    robot = panda()
    limits = of(robot, velocity=None)
    motion = limits.motion
    q, v = robot.home(), np.zeros(7)
    plain = bounds(limits, q, v)[1]
    shift = 0.1 * 100.0 * (motion.upper - motion.lower)
    past = plain - bounds(limits, q, v, 0.0, 1e6, 0.0, 0.0)[1]
    np.testing.assert_allclose(past, shift, rtol=1e-12)
    present = plain - bounds(limits, q, v, 0.0, 1e6)[1]
    np.testing.assert_allclose(present, np.maximum(shift, 0.002 * motion.jerk))
    assert (present > past).any()


@given(seeds, st.floats(-9.0, 9.0))
def test_speeds_may_be_held_against_a_steady_force(seed: int, steady: float) -> None:
    """The speed barrier is widened by the effort that holds the robot against it.

    A drift that has ended changes nothing.
    """
    rng, limits = np.random.default_rng(seed), of(panda(), position=None)
    v = limits.motion.velocity * rng.uniform(-0.9, 0.9, 7)
    q = panda().home()
    plain = bounds(limits, q, v)
    np.testing.assert_array_equal(bounds(limits, q, v, 0.0, steady), plain)
    a_lower, a_upper = bounds(limits, q, v, 0.0, steady, steady)
    up, down = max(-steady, 0.0), max(steady, 0.0)
    np.testing.assert_allclose(a_upper - up, plain[1], rtol=0, atol=1e-11)
    np.testing.assert_allclose(a_lower + down, plain[0], rtol=0, atol=1e-11)


def test_the_margin_of_the_speed_covers_an_error_up_to_half_the_speed() -> None:
    limits = of(panda(), velocity=1.0, effort_rate=None, position=None, bandwidth=8.0)
    guarded, v = limits.motion.velocity[0], np.full(7, 0.4)
    for error, speed in ((3.2, guarded - 0.05), (1e3, 0.5 * guarded)):
        a_lower, a_upper = bounds(limits, panda().home(), v, error)
        np.testing.assert_allclose(a_upper, 16.0 * (speed - v), rtol=1e-12)
        np.testing.assert_allclose(a_lower, 16.0 * (-speed - v), rtol=1e-12)


# --- the step ------------------------------------------------------------------------


@given(seeds)
@settings(max_examples=50 if THOROUGH else 20)
def test_without_an_active_limit_the_qp_gives_the_law(seed: int) -> None:
    """Wide limits: the step is the law's, to the last bit, over random states."""
    robot, rng = panda(), np.random.default_rng(seed)
    q, v = robot.random_configuration(rng), 0.3 * rng.standard_normal(7)
    field = hsp.JointCentering()
    free = hsp.Controller(robot, [hand()], field, limits=None)
    wide = hsp.Limits(effort=1e6, velocity=None, position=None)
    limited = hsp.Controller(robot, [hand()], field, limits=wide)
    state = robot.state(0.3, q, v)
    out, same = free.compute(state), limited.compute(state)
    assert same.status == Status.EXACT
    np.testing.assert_array_equal(same.tau, out.tau)


# --- along motions -------------------------------------------------------------------


def violations(rollout: hsp.Rollout, limits: RobotLimits) -> dict[str, float]:
    """Return the worst excess over each limit, in the log alone."""
    q, v, tau = rollout["q"], rollout["v"], rollout["tau"]
    rates = np.abs(np.diff(tau, axis=0)) / 1e-3
    return {
        "effort": float((np.abs(tau) - limits.effort).max()),
        "effort rate": float((rates - limits.effort_rate).max()),
        "velocity": float((np.abs(v) - limits.velocity).max()),
        "position": float(np.maximum(q - limits.upper, limits.lower - q).max()),
    }


def limit_rich(seed: int) -> tuple[hsp.Controller, RobotLimits, Array]:
    """Return a random controller with active limits, the limits, and a start."""
    robot, rng = panda(), np.random.default_rng(seed)
    lower, upper = robot.position_limits()
    q0 = 0.5 * (lower + upper) + 0.35 * (upper - lower) * rng.uniform(-1.0, 1.0, 7)
    own = of(robot)
    limits = hsp.Limits(
        effort=own.effort * rng.uniform(0.7, 1.0),
        effort_rate=1000.0,
        velocity=own.velocity * rng.uniform(0.2, 0.5),
    )
    start = robot.state(0.0, q0, np.zeros(7)).position("panda_tcp")
    center = start + rng.normal(0.0, 0.4, 3)
    path = hsp.Circle(0.2, rng.uniform(1, 6), center, normal=rng.normal(size=3))
    task = hsp.FramePosition(
        "panda_tcp", path, gains=hsp.Gains(natural_frequency=rng.uniform(5, 12))
    )
    controller = hsp.Controller(robot, [task], hsp.JointCentering(), limits=limits)
    assert controller.limits is not None
    return controller, controller.limits, q0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6 if THOROUGH else 3))
def test_no_limit_is_violated(seed: int) -> None:
    """Rollouts with active limits; benchmarks/limit_rollouts.py runs a thousand."""
    controller, limits, q0 = limit_rich(seed)
    rollout = held(controller, q0, duration=0.8)
    assert rollout.meta["status"] == "completed"
    assert (rollout["status"] == Status.LIMITED).any()  # limits were active
    worst = violations(rollout, limits)
    assert max(worst.values()) <= 1e-8, worst


@pytest.mark.slow
@pytest.mark.parametrize("period", [0.001, 0.01])
def test_a_load_that_the_model_lacks_drives_no_joint_beyond_its_limit(
    period: float,
) -> None:
    """An unmodelled load at a joint near its limit: at rest it stays at the margin.
    (With bounds from the model alone: 27 mrad beyond the limit, 15 at rest.)"""
    robot = panda()
    _, upper = robot.position_limits()
    beyond, q0 = robot.home(), robot.home()
    beyond[1], q0[1] = upper[1] + 0.2, upper[1] - 0.5
    beyond[3] = q0[3] = -0.5
    task = hsp.JointPosture(
        beyond, gains=hsp.Gains(natural_frequency=6.0), name="beyond"
    )
    load = Push("panda_tcp", (0.0, 0.0, -30.0), duration=10.0)
    plant = RigidBodyPlant(robot, [load])
    law = hsp.Controller(robot, [task])
    rollout = held(law, q0, period, duration=2.5, plant=plant)
    joint = rollout["q"][:, 1]
    assert joint.max() < upper[1]
    assert joint[-1] == pytest.approx(upper[1] - 0.005, abs=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(("angle", "side"), [(0.5, 0.05), (1.5, -0.05)])
def test_a_wrist_with_an_unknown_tool_stays_within_its_range(
    angle: float, side: float
) -> None:
    """1 kg off the flange, friction, 2 ms of delay and noise, driven to the limit.

    (116 and 86 mrad beyond it when the bounds used the mean over 0.1 s.)
    """
    robot = hsp.Robot.load("iiwa14")
    _, upper = robot.position_limits()
    q0 = robot.home()
    q0[5], q0[6] = angle, upper[6] - 0.4
    beyond = q0.copy()
    beyond[6] = upper[6] + 0.3
    most = np.asarray(robot.model.effortLimit)
    hand = robot.end_effector
    plant = RigidBody(
        inertias=Inertias(random_mass=0.2, random_com=0.01),
        payload=Payload(hand, 1.0, center=(side, side, 0.05), radius=0.03),
        friction=Friction(0.005 * most, 0.002 * most),
        sensors=[VelocityNoise(0.01)],
        drives=[EffortDelay(2)],
    )
    run = hsp.simulate(
        hsp.Controller(robot, [hsp.JointPosture(beyond)], start=q0),
        q0,
        duration=0.8,
        control_period=1e-3,
        plant=plant,
        compensation=Compensation(momentum_observer=MomentumObserver(30.0)),
        check_rate=False,
    )
    assert run["position_excess"].max() < 2e-3
    # it came near the limit
    assert run["joint_positions"][:, 6].max() > upper[6] - 0.06


def test_the_error_of_the_acceleration_is_the_observed_one() -> None:
    robot = hsp.Robot.load("planar3r")
    state, q = robot.state(0.0, robot.home(), np.zeros(3)), robot.home()
    v, a = np.array([0.1, 0.2, 0.0]), np.array([1.0, -1.0, 0.0])
    memory, tau = SentMemory.of(3), np.zeros(3)
    effort = SentEffort(state, memory)
    held = effort.held
    for k in range(100):
        state.update(0.001 * k, q, v)
        effort.record(tau, a, 0.001)
        v = v + 0.001 * (a + np.array([3.0, 0.0, 0.0]))
        engine.Observe(v=9.0 * v, held=held)(0.001 * k + 0.0005)  # within the limit
        engine.Observe(v=v, held=held)(0.001 * (k + 1))
    np.testing.assert_allclose(held.error, [3.0, 0.0, 0.0], rtol=1e-3, atol=1e-9)
    # The mean over 0.1 s of an error that has lasted as long.
    mean = [3.0 * (1.0 - np.exp(-1.0)), 0.0, 0.0]
    np.testing.assert_allclose(held.drift, mean, rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(held.steady, held.drift)
    # A position limit uses the mean over 30 ms and its largest value.
    quick = 3.0 * (1.0 - np.exp(-1.0 / 0.3))
    np.testing.assert_allclose(held.quick, [quick, 0.0, 0.0], rtol=1e-9, atol=1e-9)
    np.testing.assert_array_equal(held.most, held.quick)
    np.testing.assert_array_equal(held.lasting, held.quick)
    np.testing.assert_allclose(held.least, 0.0, atol=1e-9)
    state.update(0.1, q, v)
    effort.record(tau, a, 0.02)  # a period longer than that is used alone
    engine.Observe(v=v + 0.02 * (a - 8.0), held=held)(0.12)
    np.testing.assert_allclose(held.error, [8.0, 8.0, 8.0], rtol=1e-9)
    # The first mean still has the old sign: that error is over.
    assert held.drift[0] > 0.0
    np.testing.assert_array_equal(held.steady, [0.0, *held.drift[1:]])
    np.testing.assert_allclose(held.most[0], np.exp(-0.2) * quick, rtol=1e-9)
    np.testing.assert_array_equal(held.least, np.minimum(held.quick, 0.0))
    assert held.least[0] < 0.0  # that fast
    kept, drift, steady = deepcopy(memory), held.drift.copy(), held.steady.copy()
    memory.clear()
    assert not held.error.any()
    assert not held.drift.any()
    assert not held.steady.any()
    held = SentEffort(state, kept).held
    np.testing.assert_array_equal(held.drift, drift)
    np.testing.assert_array_equal(held.steady, steady)
    np.testing.assert_allclose(held.error, [8.0, 8.0, 8.0], rtol=1e-9)


def test_contradiction_is_relaxed_and_reported() -> None:
    """A joint that cannot brake before its limit: the smallest possible violation."""
    robot = panda()
    q, v = robot.home(), np.zeros(7)
    _, upper = robot.position_limits()
    q[3], v[3] = upper[3] - 0.02, 2.0
    limits = hsp.Limits(effort=1.0)
    out = hsp.Controller(robot, [hand()], limits=limits).compute(robot.state(0.0, q, v))
    assert np.isfinite(out.tau).all()
    assert (np.abs(out.tau) <= 1.0).all()
    assert out.status > Status.LIMITED
    assert 0.0 < out.relaxation < np.inf


def status_of(
    controller: hsp.Controller, dof: int, *, away: float = 0.0, speed: float = 0.0
) -> Status:
    """Return the status where a joint is beyond its upper end, and moves back."""
    robot = controller.robot
    q, v, (_, upper) = robot.home(), np.zeros(7), robot.position_limits()
    if away:
        q[dof] = upper[dof] + away
    v[dof] = speed * float(robot.model.velocityLimit[dof])
    return controller.compute(0.0, q, v).status


@pytest.mark.parametrize("dof", [0, 3, 6])
def test_a_measured_excess_is_reported_in_that_step(dof: int) -> None:
    """With any delivered step, also an unconstrained one on the way back."""
    law = hsp.Controller(panda(), [hsp.FramePosition("panda_tcp")])
    for _ in range(3):  # the first steps, and the later ones of a single call
        assert status_of(law, dof, away=1.1e-3) is Status.BEYOND
        assert status_of(law, dof, away=1.1e-3, speed=-0.9) is Status.BEYOND
        assert status_of(law, dof, away=0.9e-3) < Status.BEYOND
        for sign in (-1.0, 1.0):
            assert status_of(law, dof, speed=1.021 * sign) is Status.BEYOND
            assert status_of(law, dof, speed=1.019 * sign) < Status.BEYOND
    # During a change of limits the status of either set is used.
    wide = hsp.Limits(position="none", velocity=10.0)
    law.at(-1.0).ramp(10.0).limits(wide)
    assert status_of(law, dof, away=1.1e-3) is Status.BEYOND
    for limits in (None, wide):
        free = hsp.Controller(panda(), [hsp.FramePosition("panda_tcp")], limits=limits)
        assert status_of(free, dof, away=1.1e-3) < Status.BEYOND


def test_effort_rate_needs_the_sent_effort() -> None:
    robot = panda()
    limits = hsp.Limits(effort_rate=1000.0)
    controller = hsp.Controller(robot, [hand()], limits=limits)
    state = robot.state(0.0, robot.home(), np.zeros(7))
    before = state.nonlinear_effects.copy()
    controller.applied(before, 1e-3)
    out = controller.compute(state)
    assert np.abs(out.tau - before).max() <= 1.0 + 1e-9
    controller.restart()
    assert np.abs(controller.compute(state).tau - before).max() > 1.0


# --- distances -----------------------------------------------------------------------


def swinging() -> hsp.Obstacle:
    """Return a ball that moves into the arm's elbow and away again."""
    robot = panda()
    elbow = robot.state(0.0, robot.home(), np.zeros(7)).position("panda_link4")
    center = elbow + np.array([0.0, 0.35, 0.0])
    path = Lissajous([0.0, 0.28, 0.0], [1.0, 2.0, 1.0], [0.0, 3.14, 0.0], center)
    return hsp.Obstacle("ball", hsp.Sphere(0.08), path)


def elbow(limits: hsp.Limits | None) -> hsp.Controller:
    robot = panda()
    here = robot.state(0.0, robot.home(), np.zeros(7)).position("panda_tcp").copy()
    task = hsp.FramePosition(
        "panda_tcp",
        hsp.Hold(here),
        gains=hsp.Gains(natural_frequency=10.0),
        name="hand",
    )
    return hsp.Controller(
        robot,
        [task],
        hsp.JointCentering(),
        null_space_gain=6.0,
        limits=limits,
        scene=[swinging()],
    )


def test_a_step_with_minimum_distances_runs_no_python() -> None:
    """Like a step without limits; otherwise it costs ten times as much."""
    robot = panda()
    limits = hsp.Limits(barriers=[ObstacleDistance(0.02), SelfDistance()])
    law = elbow(limits)
    law.compute(0.0, robot.home(), np.zeros(7))
    bound = law._in_force.step
    assert bound is not None
    assert bound.direct
    assert not bound.move.python


@pytest.mark.slow
def test_things_stay_apart() -> None:
    """A ball swings into the elbow: without the limit it hits, with it it does not."""
    robot = panda()
    clearance = hsp.ObstacleClearance([swinging()]).placed(at_home(robot))
    proximity = clearance.proximity(at_home(robot).state)
    least: dict[bool, float] = {}
    for limited in (False, True):
        limits = hsp.Limits(barriers=[ObstacleDistance(0.02)])
        law = elbow(limits if limited else None)
        rollout = held(law, robot.home(), duration=1.1)
        least[limited] = min(
            float(proximity.measure(robot.state(t, q, v)).min())
            for t, q, v in zip(rollout.t, rollout["q"], rollout["v"], strict=True)
        )
        error = np.abs(rollout["task.hand.error"]).max()
        assert error < 1e-4  # the elbow deviates, the hand stays
    assert least[False] < 0.0
    assert least[True] > 0.02 - 1e-3
