"""A payload picked up in motion: the law uses the model of the current time."""

import copy
import pickle
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import further

import hsp_control as hsp
from hsp_control.cli.live_experiment import simulated_robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError, HspControlError
from hsp_control.control.compensation import (
    CompensatedController,
    Compensation,
    MomentumObserver,
    Predictor,
)
from hsp_control.control.first_state import StartWarning
from hsp_control.live.dead_reckoning import DeadReckoning
from hsp_control.live.loop import run_loop
from hsp_control.live.settings import LiveSettings
from hsp_control.live.simulated_robot import InProcessRobot
from hsp_control.live.still_sensors import StillSensors
from hsp_control.live.trusted_motion import TrustedMotion
from hsp_control.null_space.metrics import IdentityMetric, MassMatrixMetric, Metric
from hsp_control.robot.gravity import Gravity
from hsp_control.simulation import plants
from hsp_control.simulation.plants.rigid_body import RigidBodyPlant

MASS, CENTER = 2.0, np.array([0.03, -0.02, 0.06])
INERTIA = np.array([[0.004, 0.001, 0.0], [0.001, 0.005, 0.0], [0.0, 0.0, 0.003]])
AT, RAMP, GAIN = 0.3, 0.4, 2.0


def panda() -> hsp.Robot:
    return hsp.Robot.load("panda")


def start(robot: hsp.Robot) -> Array:
    return robot.integrate(robot.home(), 0.2 * np.sin(1.0 + np.arange(7)))


def controller(metric: Metric | None = None, **options: Any) -> hsp.Controller:
    robot = panda()
    made = hsp.Controller(
        robot,
        [hsp.FramePose("panda_tcp", hsp.Circle(0.1, 2.0), name="hand")],
        hsp.TargetPosture(robot.home(), weight=1.5),
        metric=metric,
        null_space_gain=GAIN,
        start=start(robot),
        **options,
    )
    made.at(AT).ramp(RAMP).payload("panda_hand", MASS, CENTER, INERTIA)
    return made


def loaded(share: float) -> pin.Model:
    """Return Pinocchio's model with a fraction of the payload."""
    model = panda().model.copy()
    frame = model.frames[model.getFrameId("panda_hand")]
    body = pin.Inertia(share * MASS, CENTER, share * INERTIA)
    model.inertias[frame.parentJoint] += frame.placement.act(body)
    return model


def smooth(t: float) -> float:
    """Return the fraction: the quintic 0 to 1 of Siciliano et al. (2009), (4.21)."""
    x = np.clip((t - AT) / RAMP, 0.0, 1.0)
    return float(x**3 * (10.0 - 15.0 * x + 6.0 * x * x))


@pytest.mark.parametrize("t", [0.0, 0.4, 0.5, 0.65, 5.0])
def test_terms_are_those_of_the_model_of_the_time(t: float) -> None:
    made, rng = controller(), np.random.default_rng(int(10 * t))
    q = start(panda())
    v = rng.normal(size=7)
    output = made.compute(made.robot.state(t, q, v))
    model = loaded(smooth(t))
    data, state = model.createData(), made.state
    expected = pin.rnea(model, data, q, v, output.acceleration)
    np.testing.assert_allclose(output.tau, expected, rtol=0, atol=1e-12)

    def inertia(s: float) -> Array:
        model = loaded(smooth(t + s))
        data = model.createData()
        upper = np.triu(pin.crba(model, data, pin.integrate(model, q, s * v)))
        return upper + np.triu(upper, 1).T

    np.testing.assert_allclose(state.mass_matrix, inertia(0.0), atol=1e-13)
    h = 1e-4  # its rate, including the ramp's part: an error of h⁴ and of rounding/h
    rate = (inertia(-2 * h) - 8 * inertia(-h) + 8 * inertia(h) - inertia(2 * h)) / 12
    np.testing.assert_allclose(state.mass_matrix_rate, rate / h, atol=1e-9)


@pytest.mark.parametrize("metric", [IdentityMetric(), MassMatrixMetric()], ids=str)
def test_the_law_is_exact_while_it_is_taken_up(metric: Metric) -> None:
    """The error is that without a payload, and ‖e_N‖_W decays, W = M(q, t)."""
    robot = panda()
    run = hsp.simulate(controller(metric, limits=None), start(robot), duration=1.0)
    norm = run["null_space_norm"]
    np.testing.assert_allclose(norm, norm[0] * np.exp(-GAIN * run.t), rtol=1e-7)
    bare = controller(metric, limits=None)
    bare.at(AT).ramp(RAMP).payload("panda_hand", 0.0)
    same = hsp.simulate(bare, start(robot), duration=1.0)
    error, usual = run["task.hand.error"], same["task.hand.error"]
    assert np.abs(usual).max() > 0.05
    np.testing.assert_allclose(error, usual, rtol=0, atol=1e-8)
    assert np.abs((run.tau - same.tau)[run.t < AT]).max() == 0.0
    assert np.abs((run.tau - same.tau)[-1]).max() > 5.0


def test_efforts_have_no_jump() -> None:
    """Continuous at the ends of overlapping ramps and between them."""
    made = controller(limits=None)
    made.at(0.5).ramp(0.3).payload("panda_link5", 1.0)
    made.at(0.6).ramp(0.1).payload("panda_hand", 0.5, inertia=0.001)
    q, v = start(panda()), 0.3 * np.ones(7)
    made.compute(0.0, q, v)
    for t in (AT, AT + RAMP, 0.5, 0.8, 0.6, 0.62):
        before, after = (made.compute(t + s, q, v).tau for s in (-1e-9, 1e-9))
        assert np.abs(after - before).max() < 1e-6


@pytest.mark.parametrize(
    "plant",
    [
        plants.RigidBody(friction=plants.Friction(viscous=0.1)),
        plants.RigidBody(pushes=[plants.Push("panda_link4", (0.0, 1.0, 0.0))]),
        *further(plants.RigidBody(), plants.RigidBody(sensors=[plants.SensorDelay(1)])),
    ],
)
def test_simulated_bodies_carry_it(plant: Any) -> None:
    """At 1 kHz; without payload and observer the error would be 0.1 m."""
    robot, none = panda(), Compensation(momentum_observer=None)
    made = controller(MassMatrixMetric())
    run = hsp.simulate(
        made, start(robot), duration=1.2, control_period=1e-3, plant=plant,
        compensation=none,
    )  # fmt: skip
    bare = controller(MassMatrixMetric())
    bare.at(AT).ramp(RAMP).payload("panda_hand", 0.0)
    same = hsp.simulate(
        bare, start(robot), duration=1.2, control_period=1e-3, plant=plant,
        compensation=none,
    )  # fmt: skip
    error, usual = (np.abs(r["task.hand.error"]).max() for r in (run, same))
    assert error < 2.0 * usual + 1e-4
    assert np.abs(run.tau[-1] - same.tau[-1]).max() > 5.0


def test_an_observer_does_not_take_it_for_a_disturbance() -> None:
    made = controller(MassMatrixMetric())
    run = hsp.simulate(
        made, start(panda()), duration=1.2, control_period=1e-3,
        compensation=Compensation(momentum_observer=MomentumObserver(50.0)),
    )  # fmt: skip
    # Efforts are held: the residual is of first order in the period.
    assert np.abs(run["observer.disturbance"]).max() < 0.1


def test_an_unknown_plant_is_named() -> None:
    class Own(RigidBodyPlant):
        dynamics = None  # type: ignore[assignment]

        def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
            return self.robot.forward_dynamics(q, v, tau)

    made = hsp.Controller(panda(), [hsp.FramePose()])
    made.at(0.0).payload("panda_hand", 1.0)
    with pytest.warns(StartWarning, match="Own does not follow changes of"):
        hsp.simulate(made, start(panda()), duration=0.01, plant=Own(panda()))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hsp.simulate(made, start(panda()), duration=0.01)


def test_a_copy_and_a_pickle_carry_it_on() -> None:
    made, q, v = controller(), start(panda()), 0.2 * np.ones(7)
    made.compute(0.0, q, v)
    made.compute(0.45, q, v)  # in the ramp
    others = [made.preview(), pickle.loads(pickle.dumps(made))]
    for t in (0.46, 0.6, 1.0, 3.0, 3.1):
        tau = made.compute(t, q, v).tau
        for other in others:
            np.testing.assert_array_equal(other.compute(t, q, v).tau, tau)


def test_past_changes_are_forgotten() -> None:
    made, q, v = controller(), start(panda()), np.zeros(7)
    made.compute(0.0, q, v)
    for k in range(300):
        made.at(float(k)).ramp(0.1).payload("panda_hand", 0.1 * (k % 3))
        made.compute(k + 0.5, q, v)
    made.compute(400.0, q, v)
    assert len(made.setup.payloads) <= 2


def test_gravity_changes_with_the_base() -> None:
    """On a tilted base the efforts are the model's, and the arm stays."""
    robot, tilted = panda(), np.array([0.0, 4.9, -8.5])
    made = hsp.Controller(robot, [hsp.FramePose(name="hand")], hsp.JointCentering())
    made.at(0.2).ramp(0.5).gravity(tilted)
    run = hsp.simulate(made, robot.home(), duration=1.0)
    assert np.abs(run["task.hand.error"]).max() < 1e-9
    output = made.compute(5.0, robot.home(), np.zeros(7))
    model = robot.model.copy()
    model.gravity.linear = tilted
    expected = pin.rnea(
        model, model.createData(), robot.home(), np.zeros(7), output.acceleration
    )
    np.testing.assert_allclose(output.tau, expected, rtol=0, atol=1e-12)
    with pytest.raises(ControllerError, match=r"gravity: .* is 981 m/s²; at most 300"):
        made.at(6.0).gravity([0.0, 0.0, -981.0])


def test_a_payload_is_part_of_static_effort() -> None:
    made, q = controller(), start(panda())
    made.compute(0.0, q, np.zeros(7))
    gravity = Gravity(panda().model, made.state.dynamics, made.state.world)
    for t in (0.5, 2.0):
        made.compute(t, q, np.zeros(7))
        made.state.run(gravity.calls)
        model = loaded(smooth(t))
        expected = pin.computeGeneralizedGravity(model, model.createData(), q)
        np.testing.assert_allclose(gravity.effort, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("panda_hnad", 1.0), "frame: .*'panda_hnad'; did you mean 'panda_hand'"),
        (("panda_link0", 1.0), "frame: 'panda_link0' is fixed to the world"),
        (("panda_hand", -1.0), "mass: -1.0 is negative"),
        (("panda_hand", 1.0, [0, 0, 0], [1, 2, 9]), "inertia: .*sum of the others"),
        (("panda_hand", 1.0, [0, 0, 0], [1, 2]), r"inertia: has shape \(2,\)"),
        (("panda_hand", 0.0, [0, 0, 0], 0.1), "inertia: is not 0, but the mass is"),
    ],
)
def test_invalid_payloads_are_refused(change: Any, message: str) -> None:
    made = hsp.Controller(panda(), [hsp.FramePosition()])
    with pytest.raises(HspControlError, match=message):
        made.at(0.0).payload(*change)


# --- the centre of mass, and robots that balance -------------------------------------

LEGGED = {"panda": ("panda_hand", "fixed"), "solo12": ("base_link", "free_flyer")}


def carrying(name: str, task: hsp.Task, **options: Any) -> hsp.Controller:
    """Return a controller whose robot picks up one payload and puts down another."""
    frame, root = LEGGED[name]
    robot = hsp.Robot.load(name, root=root)  # type: ignore[arg-type]
    base: Any = "flying" if robot.unactuated else None
    q = robot.home() if name == "solo12" else start(robot)
    made = hsp.Controller(robot, [task], base=base, start=q, limits=None, **options)
    last = robot.frame_names[-1]
    made.at(AT).ramp(RAMP).payload(frame, MASS, CENTER, INERTIA)
    made.at(0.0).ramp(0.0).payload(last, 0.5, CENTER)
    made.at(0.4).ramp(0.5).payload(last, 0.0)
    return made


def part_of(robot: hsp.Robot, t: float) -> list[tuple[str, pin.Inertia]]:
    """Return the carried fractions of both payloads at a time."""
    x = np.clip((t - 0.4) / 0.5, 0.0, 1.0)
    left = 1.0 - float(x**3 * (10.0 - 15.0 * x + 6.0 * x * x))
    here = pin.Inertia(smooth(t) * MASS, CENTER, smooth(t) * INERTIA)
    there = pin.Inertia(left * 0.5, CENTER, np.zeros((3, 3)))
    return [(LEGGED[robot.name][0], here), (robot.frame_names[-1], there)]


def balance(robot: hsp.Robot, t: float, q: Array, v: Array) -> tuple[Array, Array]:
    """Return Pinocchio's c and A v/m for the model of a time."""
    model = robot.model.copy()
    for name, body in part_of(robot, t):
        frame = model.frames[model.getFrameId(name)]
        model.inertias[frame.parentJoint] += frame.placement.act(body)
    data = model.createData()
    momentum = pin.computeCentroidalMomentum(model, data, q, v).angular.copy()
    # without the world's inertia
    mass = sum(each.mass for each in [*model.inertias][1:])
    c = pin.centerOfMass(model, data, q).copy()
    return c, momentum / mass


@pytest.mark.parametrize("t", [0.2, 0.45, 0.55, 0.65, 0.8, 5.0])
@pytest.mark.parametrize("name", LEGGED)
def test_the_centre_of_mass_includes_payloads_that_fade(name: str, t: float) -> None:
    """c', c'' and the rate of A v/m along a motion, by differences of fourth order."""
    made = carrying(name, hsp.tasks.CenterOfMass())
    robot, rng = made.robot, np.random.default_rng(7)
    q0 = robot.integrate(robot.home(), 0.2 * rng.normal(size=robot.nv))
    v0, a = rng.normal(size=robot.nv), rng.normal(size=robot.nv)
    made.compute(robot.state(t, q0, v0))

    # Joints of one degree of freedom add; a free-flyer's constant twist is a motion of
    # constant velocity, and its acceleration is left out.
    a[list(robot.unactuated)] = 0.0

    def along(s: float) -> tuple[Array, Array]:
        q = robot.integrate(q0, s * v0 + 0.5 * s * s * a)
        return balance(robot, t + s, q, v0 + s * a)

    h = 1e-3
    points = [along(k * h) for k in range(-2, 3)]
    c, momentum = (np.array([each[i] for each in points]) for i in range(2))
    first = np.array([1, -8, 0, 8, -1]) / 12
    second = np.array([-1, 16, -30, 16, -1]) / 12
    mass = made.state.centroidal
    np.testing.assert_allclose(mass.position, c[2], rtol=0, atol=1e-13)
    np.testing.assert_allclose(mass.velocity, first @ c / h, rtol=0, atol=1e-9)
    moved = mass.jacobian @ a + mass.jacobian_dot @ v0 + mass.own_acceleration
    np.testing.assert_allclose(moved, second @ c / h**2, rtol=0, atol=1e-6)
    turned = mass.momentum_matrix @ a + mass.momentum_matrix_dot @ v0
    rate = turned / mass.mass + mass.own_momentum
    np.testing.assert_allclose(rate, first @ momentum / h, rtol=0, atol=1e-8)
    if 0.4 < t < 0.7:
        assert np.abs(mass.own_acceleration).max() > 1e-3
        assert np.abs(mass.own_momentum).max() > 1e-5


@pytest.mark.parametrize(
    "task",
    [
        hsp.tasks.CenterOfMass(hsp.Circle(0.02, 2.0), name="hand"),
        hsp.tasks.AngularMomentum(rate=4.0, name="hand"),
    ],
    ids=["centre", "momentum"],
)
def test_balance_obeys_its_equation_while_it_is_taken_up(task: hsp.Task) -> None:
    """The error equals that without a payload up to the integrator's error."""
    # Per mass a momentum is small: so are the singular values of its rows.
    made = carrying("panda", task, singularity_threshold=1e-4)
    robot = made.robot
    v = 0.3 * np.sin(np.arange(7.0))
    run = hsp.simulate(made, start(robot), v0=v, duration=1.0)
    error = run["task.hand.error"]
    assert np.abs(error[0]).max() > 1e-3
    if task.order == 1:
        expected = error[0] * np.exp(-4.0 * run.t)[:, None]
    else:
        e0, rate = error[0], run["task.hand.error_rate"][0]
        gains = task.feedback()  # critically damped
        w = np.sqrt(np.diag(gains.Kp))
        t = run.t[:, None]
        expected = (e0 + (rate + w * e0) * t) * np.exp(-w * t)
    np.testing.assert_allclose(error, expected, rtol=0, atol=2e-7)


def test_a_robot_on_feet_takes_up_a_payload() -> None:
    """The trunk stays, and the ground carries the weight."""
    experiment = hsp.load_experiment("whole_body/solo12_trunk")
    made, robot = experiment.controller, experiment.robot
    made.at(0.1).ramp(0.2).payload("base_link", 0.5, [0.05, 0.0, 0.05])
    q, v = experiment.q0, np.zeros(robot.nv)
    light = made.compute(0.0, q, v).forces.copy()
    heavy = made.compute(1.0, q, v).forces
    up = heavy.reshape(-1, 3)[:, 2].sum() - light.reshape(-1, 3)[:, 2].sum()
    acceleration = made.compute(1.0, q, v).acceleration
    assert up == pytest.approx(0.5 * 9.81, abs=0.05 + 10.0 * np.abs(acceleration).max())


def test_a_configuration_declares_it(tmp_path: Path) -> None:
    text = (
        "robot: {name: panda}\ntasks: {hand: {type: frame_pose}}\n"
        "changes: [{type: payload, frame: panda_hand, mass: 2, center: [0, 0, 0.06],\n"
        "           inertia: 0.004, at: 0.2, ramp: 0.2}]\n"
        "simulation: {duration: 0.6, control_period: 0.001}\n"
    )
    file = tmp_path / "carry.yaml"
    file.write_text(text)
    run = hsp.load_experiment(str(file)).run()
    error = np.linalg.norm(run["task.hand.error"], axis=1)
    assert error.max() < 5e-4  # the prediction lags behind the ramp by two periods
    assert error[-1] < 2e-4
    assert np.abs(run.tau[-1] - run.tau[0]).max() > 5.0


def test_a_live_robot_and_its_safe_stop_carry_it(tmp_path: Path) -> None:
    """Also during a stop: without the payload the hand would sink by centimetres."""
    text = (
        "robot: {name: panda}\ntasks: {hand: {type: frame_pose}}\n"
        "changes: [{type: payload, frame: panda_hand, mass: 2, at: 0.2, ramp: 0.2}]\n"
        "simulation: {duration: 0.8, control_period: 0.002}\n"
    )
    file = tmp_path / "carry.yaml"
    file.write_text(text)
    experiment = hsp.load_experiment(str(file))
    arm = simulated_robot(experiment)
    report = run_loop(experiment.controller, InProcessRobot(arm), duration=0.8)
    assert report.reason == "the duration is over"
    moved = np.abs(experiment.robot.difference(experiment.q0, arm.q)).max()
    assert moved < 1e-3
    assert np.abs(arm.tau - experiment.robot.state(0.0, arm.q, 0 * arm.v)
                  .nonlinear_effects).max() > 5.0  # fmt: skip


def test_the_checks_of_a_live_loop_carry_it() -> None:
    """Predicted states, efforts beyond holding ones, and changes of momentum."""
    made, model, settings = controller(), loaded(1.0), LiveSettings()
    robot, rng, rest = made.robot, np.random.default_rng(4), np.zeros(7)
    q, v, tau = start(robot), rng.normal(size=7), 10.0 * rng.normal(size=7)
    made.restart(origin=0.0)
    made.compute(5.0, q, v)  # after the ramp
    dynamics, data = made.state.dynamics, model.createData()
    M = pin.crba(model, data, q)
    M = np.triu(M) + np.triu(M, 1).T
    free = pin.aba(model, data, q, v, tau).copy()
    close = {"rtol": 1e-9, "atol": 1e-9}

    reckoning = DeadReckoning(robot, 1e-3, dynamics)
    reckoning.correct(5.0, q, v)
    reckoning.predict(tau)
    np.testing.assert_allclose(reckoning.state.v, v + 1e-3 * free, **close)

    still = StillSensors(robot, settings, np.full(7, 100.0), 1e-3)
    moves = np.ones(7)
    moves[2] = 0.0  # its readings stay the same to the last bit
    for k in range(100):
        noise = moves * np.sin(k)
        still.update(1e-4 * noise, v + 0.1 * noise, v, 1e-3)
    still.judge(q, v, tau, dynamics)
    holding = free[2] / np.linalg.inv(M)[2, 2]
    np.testing.assert_allclose(still.beyond, holding * np.eye(7)[2], **close)

    motion = TrustedMotion(robot, settings, 1e-3, dynamics)
    motion.applied(q, v, tau, rest)
    driving = motion._driving
    assert driving is not None
    np.testing.assert_allclose(driving.inertia, M, **close)
    np.testing.assert_allclose(driving.effort, M @ free, **close)
    gravity = pin.rnea(model, data, q, rest, rest)
    np.testing.assert_allclose(driving.gravity, gravity, **close)


@pytest.mark.parametrize("change", ["payload", "gravity"])
def test_a_predictor_carries_it(change: str) -> None:
    """An effort that acts two periods late is predicted with the model of its time."""
    robot = hsp.Robot.load("panda")
    made = hsp.Controller(robot, [hsp.FramePosition(name="hand")], limits=None)
    at = made.at(0.05).ramp(0.1)
    if change == "payload":
        at.payload("panda_hand", 3.0)
    else:
        at.gravity([0.0, 0.0, -4.0])
    exact = hsp.plants.IntegratedPlant(RigidBodyPlant(robot), hsp.integrators.Rk4(1e-3))
    delayed = hsp.plants.ImperfectPlant(exact, drives=[hsp.plants.EffortDelay(2)])
    late = Compensation(momentum_observer=None, predictor=Predictor(effort_delay=2))
    run = hsp.simulate(
        made,
        robot.home(),
        duration=0.5,
        control_period=1e-3,
        compensation=late,
        plant=delayed,
    )
    error = np.linalg.norm(run["task.hand.error"], axis=1)
    assert error.max() < 5e-4  # the prediction lags behind the ramp by two periods
    assert error[-1] < 2e-4


@pytest.mark.parametrize(
    "duplicate", [copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_a_copy_with_a_predictor_and_an_observer_carries_it_on(duplicate: Any) -> None:
    robot = hsp.Robot.load("panda")
    made = hsp.Controller(robot, [hsp.FramePosition(name="hand")])
    made.at(0.01).ramp(0.01).payload("panda_hand", 2.0).gravity([0.0, 0.0, -5.0])
    own = Compensation(momentum_observer=MomentumObserver(), predictor=Predictor())
    first = CompensatedController(made, own)
    q, v = robot.home(), np.zeros(7)
    for k in range(3):
        first.effort(k * 1e-3, q, v, 1e-3)
    second = duplicate(first)
    for k in range(3, 40):
        tau = first.effort(k * 1e-3, q, v, 1e-3)
        assert second.effort(k * 1e-3, q, v, 1e-3).tobytes() == tau.tobytes(), k
