"""Each compensator alone, and their combined effect."""

import copy
import pickle
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from compensation_cases import ALL, EVERYTHING, PANDA, Q0, H, circle, controller
from compensators import ALONE, only
from numpy.testing import assert_allclose, assert_array_equal
from places import covering, further
from robot_kinds import KINDS
from scipy.linalg import expm
from task_cases import placed

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.control.compensation import (
    CompensatedController,
    Compensation,
    FrictionFeedForward,
    IntegralAction,
    MomentumObserver,
    Predictor,
    StartUpRamp,
    VelocityFilter,
)
from hsp_control.control.compensation.integral_action import RunningIntegral
from hsp_control.control.compensation.velocity_filter import RunningFilter
from hsp_control.null_space.fields import TargetPosture
from hsp_control.robot.friction import JointFriction
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants.drives import EffortDelay
from hsp_control.simulation.plants.model_changes import Inertias, changed
from hsp_control.simulation.plants.sensors import SensorDelay, VelocityNoise
from hsp_control.tasks import RelativePose
from hsp_control.trajectories import HoldOrientation, HoldPose


def run(
    made: hsp.Controller, compensation: Compensation | None = None, **options: Any
) -> hsp.Rollout:
    settings: dict[str, Any] = {
        "duration": 0.3, "control_period": H, "log_period": H, "integrator": Rk4(H),
        "compensation": compensation or ALONE, **options,
    }  # fmt: skip
    return hsp.simulate(made, Q0, **settings)


# ----------------------------------------------------------------------- the chain


def test_without_compensators_it_is_the_controller_to_the_last_bit() -> None:
    """Beside a loop written by hand, as a user would, on a noisy plant."""
    made = controller(limits=hsp.Limits(effort_rate=1000.0))
    engine = hsp.plants.IntegratedPlant(hsp.plants.RigidBodyPlant(PANDA), Rk4(H))
    plant = hsp.plants.ImperfectPlant(engine, [VelocityNoise(0.02)], [], seed=3)
    ours = run(made, plant=plant, duration=0.1)

    state = hsp.RobotState(PANDA)
    q, v = Q0, np.zeros(7)
    plant.reset(0.0, q, v)
    made.restart()
    for k in range(100):
        shown = plant.measure(ours.t[k], q, v)
        tau = made.compute(state.update(ours.t[k], *shown)).tau.copy()
        assert np.array_equal(tau, ours.tau[k])
        assert np.array_equal(q, ours.q[k])
        end = ours.t[k + 1]
        made.applied(tau, end - ours.t[k])
        q, v = plant.advance(ours.t[k], end, tau)


def pickled(each: Any) -> Any:
    return pickle.loads(pickle.dumps(each))


@pytest.mark.slow
@pytest.mark.parametrize("name", [*EVERYTHING, "all"])
def test_a_run_repeats_itself_and_its_compensators_travel(name: str) -> None:
    compensation = ALL if name == "all" else only(**{name: EVERYTHING[name]})
    assert compensation.names == (tuple(EVERYTHING) if name == "all" else (name,))
    made = controller()
    first = run(made, compensation, duration=0.05)
    again = run(made, compensation, duration=0.05)
    other = run(controller(), pickle.loads(pickle.dumps(compensation)), duration=0.05)
    for column, values in first.columns.items():
        assert_array_equal(values, again[column])
        assert_array_equal(values, other[column])
    bare = run(made, duration=0.05)
    # No state remains in the controller or its tasks.
    assert_array_equal(bare.tau, run(controller(), duration=0.05).tau)
    assert set(bare.columns) <= set(first.columns)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickled])
@pytest.mark.parametrize("name", [*EVERYTHING, "default", "all"])
def test_a_copy_of_a_chain_goes_on_and_moves_nothing(
    name: str, copied: Callable[[Any], Any]
) -> None:
    """During a run whose applied efforts differ from the returned ones."""
    alone = {} if name in ("default", "all") else {name: EVERYTHING[name]}
    compensation = {"default": Compensation(), "all": ALL}.get(name) or only(**alone)
    original, untouched = (
        CompensatedController(controller(), compensation) for _ in range(2)
    )

    def efforts(of: CompensatedController, begin: int, end: int) -> list[bytes]:
        found = []
        for k in range(begin, end):
            q, v = (
                Q0 + 1e-3 * np.sin(0.1 * k + np.arange(7)),
                0.1 * np.cos(0.1 * k + Q0),
            )
            found.append(of.effort(k * H, q, v, H).tobytes())
            of.applied(0.9 * of.output.tau, H)
        return found

    efforts(original, 0, 20), efforts(untouched, 0, 20)
    twin = copied(original)
    expected = efforts(untouched, 20, 60)
    assert efforts(twin, 20, 60) == expected
    assert efforts(original, 20, 60) == expected


def test_compensators_need_a_control_period() -> None:
    with pytest.raises(
        SimulationError, match=r"compensation \(predictor\) is computed"
    ):
        run(controller(), Compensation(predictor=Predictor(1)), control_period=None)


# ------------------------------------------------------------------ momentum observer


@pytest.mark.parametrize(
    ("name", "rate"), covering(["panda", "iiwa14", "planar3r"], [20.0, 200.0])
)
def test_the_observer_is_a_low_pass_of_the_push(name: str, rate: float) -> None:
    """r = d (1 - exp(-K_O t)) for a constant d, while the robot falls.

    The mean of Cᵀv - G over a period is good to h²/12 of its second derivative: 1e-4.
    """
    robot, rng = hsp.Robot.load(name), np.random.default_rng(1)
    nv = robot.nv
    d, tau = rng.uniform(-5.0, 5.0, nv), rng.uniform(-5.0, 5.0, nv)
    observer = MomentumObserver(rate).begin(robot)
    plant = hsp.plants.IntegratedPlant(hsp.plants.RigidBodyPlant(robot), Rk4(H))
    q, v = robot.home(), rng.uniform(-0.5, 0.5, nv)
    plant.reset(0.0, q, v)
    for k in range(100):
        r = observer.update(robot.state(0.0, q, v), tau, H)
        expected = d * (1.0 - np.exp(-rate * k * H))
        assert_allclose(r, expected, atol=2e-3)
        q, v = plant.advance(k * H, (k + 1) * H, tau + d)


def test_the_compensation_is_clipped() -> None:
    """Beyond the bound the arm yields as without an observer."""
    heavy = changed(PANDA, [Inertias(1.5)])
    plant = hsp.plants.RigidBodyPlant(heavy)
    clipped, free = (
        run(
            controller(),
            Compensation(momentum_observer=MomentumObserver(50.0, clip)),
            plant=plant,
        )
        for clip in (1.0, None)
    )
    assert np.abs(free["observer.disturbance"][-1]).max() > 5.0
    errors = [np.linalg.norm(log["task.hand.error"][-1]) for log in (clipped, free)]
    assert errors[0] > 10.0 * errors[1]
    state = hsp.RobotState(PANDA)
    own = MomentumObserver(50.0, [1.0] * 7)
    command = CompensatedController(controller(), Compensation(momentum_observer=own))
    for k in range(5):
        command.effort(k * H, Q0, np.zeros(7), H)
    disturbance = np.asarray(command.log_channels()["observer.disturbance"].value)
    disturbance[:] = 100.0
    command.effort(5 * H, Q0, np.zeros(7), H)
    assert (disturbance > 50.0).all()
    bare = command.controller.compute(state.update(5 * H, Q0, np.zeros(7))).tau
    modified = command.evaluate(5 * H, Q0, np.zeros(7)).tau
    assert_allclose(modified, bare - 1.0, atol=1e-12)


# ------------------------------------------------------------- friction feed-forward


def test_known_friction_costs_nothing_and_the_observer_leaves_it_alone() -> None:
    """Exactly known viscous friction: the law is the same as without friction.

    The observer would cancel all of it if the feed-forward were part of its model: the
    friction here is some 0.5 N·m.
    """
    made = controller(away=0.0)
    oil = hsp.plants.StickingPlant(PANDA, JointFriction.of(PANDA, viscous=2.0), H / 2.0)
    known = FrictionFeedForward(viscous=2.0)
    flow = {"v0": made.flow(0.0, Q0)}  # no transient
    bare, alone = run(made, **flow), run(made, plant=oil, **flow)
    off = np.abs(alone["task.hand.error"] - bare["task.hand.error"]).max()
    assert off > 8e-4  # [m]
    late = slice(1, None)
    for compensation in (
        only(friction_feed_forward=known),
        Compensation(
            friction_feed_forward=known, momentum_observer=MomentumObserver(50.0)
        ),
    ):
        log = run(made, compensation, plant=oil, **flow)
        friction = np.abs(2.0 * log.v[late]).max()
        assert_allclose(
            log["friction.feed_forward"][late], 2.0 * log.v[late], atol=0.2 * friction
        )
        errors = log["task.hand.error"][late] - bare["task.hand.error"][late]
        assert np.abs(errors).max() < 0.1 * off
        if compensation.observer is not None:
            assert np.abs(log["observer.disturbance"][late]).max() < 0.1 * friction


def test_an_effort_that_is_reported_as_sent_changes_nothing() -> None:
    """A live loop reports it every period; the friction in it is no disturbance."""
    own = Compensation(
        friction_feed_forward=FrictionFeedForward(coulomb=1.0, viscous=2.0),
        momentum_observer=MomentumObserver(50.0),
    )
    reported, alone = (CompensatedController(controller(), own) for _ in range(2))
    for k in range(30):
        q = Q0 + 1e-3 * np.sin(0.1 * k + np.arange(7))
        v = 0.1 * np.cos(0.1 * k + Q0)
        tau = reported.effort(k * H, q, v, H).copy()
        assert_array_equal(tau, alone.effort(k * H, q, v, H), err_msg=str(k))
        reported.applied(tau, H)
    friction = reported.log_channels()["friction.feed_forward"].value
    assert np.abs(friction).max() > 0.5


@pytest.mark.parametrize("levels", [1, 2, 3])
def test_the_desired_velocity_is_the_law_s_flow(levels: int) -> None:
    """v_d = J# x_d' + P g for any v: the measured velocity and its noise cancel."""
    from hsp_control.control.compensation.friction_feed_forward import desired_velocity

    robot, rng = PANDA, np.random.default_rng(2)
    own: dict[str, Any] = {
        "gains": hsp.Gains(natural_frequency=5.0),
        "largest_error": "none",
    }
    turned = hsp.FrameOrientation("panda_tcp", HoldOrientation(np.eye(3)), **own)
    again = hsp.FramePosition("panda_tcp", circle().trajectory, name="more", **own)
    second, third = replace(turned, priority=2), replace(again, priority=3)
    tasks: list[hsp.Task] = {
        1: [circle(), turned],
        2: [circle(), second],
        3: [circle(), second, third],  # nine rows, seven joints
    }[levels]
    made = hsp.Controller(
        robot, tasks, TargetPosture(np.zeros(7) + Q0 * 0.9), limits=None
    )
    q = robot.integrate(Q0, rng.uniform(-0.3, 0.3, 7))
    flow = made.flow(0.4, q)
    for _ in range(5):
        state = robot.state(0.4, q, rng.uniform(-1.0, 1.0, 7))
        made.compute(state)
        # Rounding of a product of inverses, at velocities of 1 rad/s.
        assert_allclose(desired_velocity(state, made.active_stack), flow, atol=1e-12)


# ------------------------------------------------------------------ integral action


def all_tasks() -> list[hsp.Task]:
    robot, gains = PANDA, hsp.Gains(natural_frequency=3.0)
    here = robot.state(0.0, Q0, np.zeros(7)).frame("panda_tcp")
    turn = HoldOrientation(here.rotation)
    pose = HoldPose(here.position, here.rotation)
    return [
        circle(),
        hsp.FrameOrientation("panda_tcp", turn, gains=gains),
        hsp.FramePose("panda_tcp", pose, gains=gains),
        hsp.Pointing("panda_tcp", axis=[0.0, 0.0, 1.0], trajectory=turn, gains=gains),
        hsp.JointPosture(Q0, gains=gains),
        hsp.CenterOfMass(hsp.Hold([0.1, 0.0, 0.4]), gains=gains),
        RelativePose("panda_tcp", pose, reference="panda_link0", gains=gains),
    ]


@pytest.mark.parametrize("task", all_tasks(), ids=lambda task: type(task).__name__)
def test_an_offset_enters_each_error_equation_exactly(task: hsp.Task) -> None:
    """e'' + Kv e' + Kp e + offset = 0, e'' by central differences of e'."""
    robot, rng = PANDA, np.random.default_rng(5)
    task = placed(task, robot)
    q = robot.integrate(Q0, rng.uniform(-0.2, 0.2, 7))
    v = rng.uniform(-0.5, 0.5, 7)
    feedback = task.feedback()
    feedback.offset[:] = rng.uniform(-3.0, 3.0, task.rows)
    here = task.evaluate(robot.state(0.3, q, v), feedback=feedback)
    e, e_dot = here.error.copy(), here.error_rate.copy()
    bent = here.acceleration - here.jacobian_dot @ v
    a = np.linalg.lstsq(here.jacobian, bent, rcond=None)[0]
    rates = []
    h = 1e-5
    for s in (h, -h):
        moved = robot.integrate(q, s * v + 0.5 * s * s * a)
        near = robot.state(0.3 + s, moved, v + s * a)
        rates.append(task.evaluate(near, feedback=feedback).error_rate)
    Kp, Kv, offset, *_ = feedback
    residual = (rates[0] - rates[1]) / (2 * h) + Kv @ e_dot + Kp @ e
    # Rounding 1e-16/h and the truncation h², relative to terms of 3 and more.
    assert_allclose(residual, -offset, atol=1e-7)


def test_with_an_integral_the_error_is_that_of_the_third_order() -> None:
    """From an offset start, against the exponential of the companion matrix.

    Held efforts cause the difference, of first order in h: 1 % of the error's size.
    """
    robot = PANDA
    made = controller()
    q = robot.integrate(Q0, np.array([0.0, 0.05, 0.0, 0.05, 0.0, 0.0, 0.0]))
    ki = {"hand": [400.0, 800.0, 1200.0]}
    log = hsp.simulate(
        made, q, duration=0.5, control_period=H / 2, log_period=0.01,
        integrator=Rk4(H / 2),
        compensation=Compensation(integral_action=IntegralAction(ki=ki)),
    )  # fmt: skip
    for row, Ki in enumerate(ki["hand"]):
        A = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-Ki, -400.0, -40.0]])
        e, rate = log["task.hand.error"][0, row], log["task.hand.error_rate"][0, row]
        expected = [(expm(A * t) @ [0.0, e, rate])[1] for t in log.t]
        size = np.abs(expected).max()
        assert_allclose(log["task.hand.error"][:, row], expected, atol=0.01 * size)


def test_an_integral_only_unwinds_while_the_law_is_not_delivered() -> None:
    made = controller()
    action = RunningIntegral(IntegralAction(10.0, limit=8.0), made)
    offset = made.feedback("hand").offset
    e = np.array([1e-3, -1e-3, 0.0])
    action.advance({0: e}, 0.5, saturated=False)
    assert_allclose(action.integrals[0], 0.5 * e)
    assert_allclose(offset, 4000.0 * 0.5 * e)
    action.advance({0: e}, 0.5, saturated=True)  # would grow: frozen
    assert_allclose(action.integrals[0], 0.5 * e)
    action.advance({0: -e}, 0.25, saturated=True)  # unwinds
    assert_allclose(action.integrals[0], 0.25 * e)
    action.advance({0: e}, 100.0, saturated=False)
    assert np.abs(offset).max() == pytest.approx(8.0)
    action.advance({}, 1.0, saturated=False)
    assert np.abs(offset).max() == pytest.approx(8.0)


def test_an_integral_goes_on_where_other_tasks_come_and_go() -> None:
    """It is the sum of all errors, over periods of H, up to rounding."""
    made = controller()
    command = CompensatedController(made, only(integral_action=IntegralAction(5.0)))
    wrist = hsp.JointPosture(Q0, joints=["panda_joint7"], name="wrist")
    total, q, names = np.zeros(3), Q0 + 0.02, set()
    for k in range(60):
        if k == 20:
            made.at(k * H).ramp(0.01).add(wrist)
        if k == 40:
            made.at(k * H).ramp(0.01).remove("wrist")
        command.effort(k * H, q, np.zeros(7), H)
        total += H * command.output.error("hand")
        columns = command.log_channels()
        names |= set(columns)
        found = columns["task.hand.integral"].value
        assert_allclose(found, total, rtol=1e-12, err_msg=str(k))
    assert "task.wrist.integral" in names
    assert np.abs(total).max() > 1e-4


# ------------------------------------------------------------------ other compensators


@pytest.mark.parametrize("order", [1, 2])
def test_half_of_the_power_passes_at_the_cut_off(order: int) -> None:
    declared = VelocityFilter(20.0, order)
    own = RunningFilter(declared)
    assert own.apply(np.full(3, 4.0), 0.0).tolist() == [4.0] * 3
    for _ in range(50):
        assert_allclose(own.apply(np.full(3, 4.0), H), 4.0, rtol=1e-12)
    for frequency, gain in ((20.0, 0.5**0.5), (2.0, 1.0), (200.0, 0.1**order)):
        t = np.arange(0.0, 2.0, H / 4.0)
        own = RunningFilter(declared)
        out = np.array(
            [own.apply(np.sin([2 * np.pi * frequency * s]), H / 4) for s in t]
        )
        size = np.abs(out[len(t) // 2 :]).max()
        # Sampling changes the first-order response by 2 % at a twentieth of the rate.
        assert size == pytest.approx(gain, rel=0.03)
    t = np.arange(0.0, 1.0, H)
    own = RunningFilter(declared)
    late = np.array([own.apply(np.array([s]), H)[0] for s in t])
    # A held input has itself a delay of half a period.
    assert t[-1] - late[-1] == pytest.approx(declared.delay, abs=0.51 * H)


@pytest.mark.parametrize(
    ("efforts", "sensors"), [(2, 0), (1, 2), *further((1, 0), (0, 1))]
)
def test_the_predictor_returns_the_later_state(efforts: int, sensors: int) -> None:
    """The law uses the predicted state at which its effort acts, to Rk4's error."""
    plant = hsp.plants.ImperfectPlant(
        hsp.plants.IntegratedPlant(hsp.plants.RigidBodyPlant(PANDA), Rk4(H)),
        [SensorDelay(sensors)] if sensors else [],
        [EffortDelay(efforts)] if efforts else [],
    )
    log = run(controller(), only(predictor=Predictor(efforts, sensors)), plant=plant)
    k = efforts
    started = efforts + sensors + 1
    shown, then = log["shown.q"][started : len(log) - k], log.q[started + k :]
    assert_allclose(shown, then, atol=1e-12)
    shown, then = log["shown.v"][started : len(log) - k], log.v[started + k :]
    assert_allclose(shown, then, atol=1e-10)


@pytest.mark.parametrize(("efforts", "sensors"), [(1, 0), (2, 0), (0, 1), (1, 2)])
def test_the_law_is_of_the_time_at_which_its_effort_acts(
    efforts: int, sensors: int
) -> None:
    """The effort sent at t is that of the moving task at t + the drives' delay."""
    made, state = controller(), hsp.RobotState(PANDA)
    compensation = Compensation(predictor=Predictor(efforts, sensors))
    log = run(made, compensation, duration=0.05)

    def effort(k: int, lead: int) -> Array:
        then = log.t[k] + lead * H
        shown = log["shown.q"][k], log["shown.v"][k]
        return made.compute(state.update(then, *shown)).tau.copy()

    for k in (0, 7, 40):
        assert_allclose(effort(k, efforts), log.tau[k], rtol=0, atol=1e-9)
        other = effort(k, efforts + 1) - log.tau[k]
        assert np.abs(other).max() > 1e-3  # a delay wrong by one period would fail


@pytest.mark.parametrize("frequency", [0.0, 10.0])
def test_the_ramp_leads_from_gravity_to_the_law(frequency: float) -> None:
    made = controller()
    q = PANDA.integrate(Q0, np.full(7, 0.05))
    ramp = Compensation(start_up_ramp=StartUpRamp(0.2, frequency))
    options: dict[str, Any] = {
        "duration": 0.4, "control_period": H, "log_period": H, "integrator": Rk4(H)
    }  # fmt: skip
    jumping = hsp.simulate(made, q, **options)
    smooth = hsp.simulate(made, q, compensation=ramp, **options)
    gravity = PANDA.inverse_dynamics(q, np.zeros(7), np.zeros(7))
    assert_allclose(smooth.tau[0], gravity, atol=1e-12)
    assert np.abs(jumping.tau[0] - gravity).max() > 5.0
    steps = np.abs(np.diff(smooth.tau, axis=0)).max()
    assert steps < 0.02 * np.abs(jumping.tau[0] - gravity).max()
    state = hsp.RobotState(PANDA)
    for k in (250, 400):  # the ramp is over: the law, exactly
        here = state.update(smooth.t[k], smooth.q[k], smooth.v[k])
        assert_array_equal(made.compute(here).tau, smooth.tau[k])
    # At first a spring holds the arm at its initial posture.
    assert np.abs(smooth.q[40] - q).max() < (0.02 if frequency else 0.03)


def test_the_spring_of_a_ramp_pulls_back_a_ball_joint(tmp_path: Path) -> None:
    """The blend of the efforts of spring and law, with s of the smooth step."""
    robot, rng = KINDS["ball, rotors"](tmp_path), np.random.default_rng(0)
    q0, rest, w = robot.neutral(), np.zeros(robot.nv), 10.0
    place = robot.state(0.0, q0, rest).position("link2") + 0.1
    made = hsp.Controller(
        robot, [hsp.FramePosition("link2", hsp.Hold(place))], limits=None
    )
    command = CompensatedController(made, only(start_up_ramp=StartUpRamp(0.2, w)))
    command.effort(0.0, q0, rest, H)
    away, v = rng.uniform(-0.3, 0.3, robot.nv), rng.uniform(-1.0, 1.0, robot.nv)
    q = robot.integrate(q0, away)
    tau = command.effort(0.05, q, v, H).copy()
    law = made.compute(0.05, q, v).tau
    state, u = robot.state(0.05, q, v), 0.25
    s = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    spring = state.mass_matrix @ (-w * w * away - 2.0 * w * v)
    held = spring + state.nonlinear_effects
    assert_allclose(tau, (1.0 - s) * held + s * law, rtol=1e-9, atol=1e-9)
