"""A compliant hand along whole motions: the effects of an external force.

The law runs in the integrator's stages, so that the comparison is one of the equations
themselves; where efforts are held, the difference is given.
"""

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest
from loaded_robots import panda
from places import further
from scipy.integrate import simpson

import hsp_control as hsp
from hsp_control import Controller, FramePose, FramePosition, Rollout
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError
from hsp_control.control.compensation import Compensation, MomentumObserver
from hsp_control.control.compensation.linear_loop import LinearLoop
from hsp_control.control.gains_in_force import held_radius
from hsp_control.null_space.metrics import IdentityMetric, MassMatrixMetric, Metric
from hsp_control.robot.integrators import Dop853, Rk4
from hsp_control.simulation.plants import Push, RigidBody
from hsp_control.tasks import Impedance

PRECISE = Dop853(rtol=1e-11, atol=1e-11)
FORCE, MOMENT = np.array([25.0, -15.0, 20.0]), np.array([1.5, -1.0, 0.7])
POSE = Impedance([500, 700, 600, 25, 30, 20], damping_ratio=0.8)


def start() -> Array:
    return panda().integrate(panda().home(), 0.1 * np.cos(1.0 + np.arange(7)))


def position_hand(**fields: Any) -> FramePosition:
    return FramePosition("panda_tcp", name="hand", largest_error="none", **fields)


def pose_hand(**fields: Any) -> FramePose:
    return FramePose("panda_tcp", name="hand", largest_error="none", **fields)


def run(
    hand: hsp.Task, metric: Metric, pushes: list[Push], gain: float = 3.0, **how: Any
) -> Rollout:
    """Return a run from rest with e_N ≠ 0; the controller has no model of pushes."""
    robot, q = panda(), start()
    away = robot.integrate(q, 0.4 * np.sin(1.0 + np.arange(7)))
    field = hsp.TargetPosture(away, weight=1.5)
    controller = Controller(
        robot, [hand], field, null_space_gain=gain, metric=metric, limits=None
    )
    how = {"duration": 0.8, "log_period": 0.02, "integrator": PRECISE} | how
    plant = RigidBody(pushes=pushes).build(robot, how["integrator"])
    return hsp.simulate(controller, q, plant=plant, **how)


# --- the theorem ---------------------------------------------------------------------

CASES = {
    "position": (position_hand(impedance=Impedance(600.0, damping_ratio=0.7)),
                 Push("panda_tcp", FORCE, duration=10.0)),
    "pose": (pose_hand(impedance=POSE),
             Push("panda_tcp", FORCE, MOMENT, duration=10.0)),
    "gains": (pose_hand(), Push("panda_tcp", FORCE, MOMENT, duration=10.0)),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_an_unknown_force_at_the_hand_does_not_reach_the_null_space(name: str) -> None:
    """With W = M: e_N' = -K_N e_N - P M⁻¹J_hᵀ f, and P M⁻¹J_hᵀ = 0.

    The same for gains and for an impedance. With W = I the same force has an effect.
    """
    hand, push = CASES[name]
    pushed = run(hand, MassMatrixMetric(), [push])
    predicted = pushed["null_space_norm"][0] * np.exp(-3.0 * pushed.t)
    assert predicted[0] > 0.05
    assert np.abs(pushed["task.hand.error"]).max() > 0.02  # the hand yields
    np.testing.assert_allclose(pushed["null_space_norm"], predicted, rtol=1e-8)
    felt = run(hand, IdentityMetric(), [push])
    predicted = felt["null_space_norm"][0] * np.exp(-3.0 * felt.t)
    assert (felt["null_space_norm"] / predicted).max() > 3.0


# --- the spring ----------------------------------------------------------------------


@pytest.mark.parametrize(
    "metric", [IdentityMetric(), *further(MassMatrixMetric())], ids=repr
)
def test_under_a_constant_force_the_hand_rests_where_the_spring_holds_it(
    metric: Metric,
) -> None:
    """x - x_d = K⁻¹ f, for a matrix K too; a moment rotates it about the moment's
    axis."""
    coupled = np.array([[600.0, 150.0, 0.0], [150.0, 400.0, -80.0], [0, -80.0, 500.0]])
    stiffness = np.zeros((6, 6))
    stiffness[:3, :3], stiffness[3:, 3:] = coupled, np.diag([25.0, 30.0, 20.0])
    hand = pose_hand(impedance=Impedance(stiffness))
    rest = run(
        hand,
        metric,
        [Push("panda_tcp", FORCE, duration=60.0)],
        duration=6.0,
        integrator=Rk4(0.004),
        gain=5.0,
    )
    moved = np.linalg.solve(coupled, FORCE)
    error = rest["task.hand.error"][-1]
    np.testing.assert_allclose(-error[:3], moved, rtol=1e-5)
    np.testing.assert_allclose(error[3:], 0.0, atol=1e-5)


def inertia(q: Array, rows: int) -> Array:
    state = panda().state(0.0, q, np.zeros(7))
    J = state.frame("panda_tcp").jacobian[:rows]
    return np.linalg.inv(J @ np.linalg.solve(state.mass_matrix, J.T))


@pytest.mark.parametrize(
    "metric", [MassMatrixMetric(), *further(IdentityMetric())], ids=repr
)
def test_the_energy_is_the_input_less_the_dissipation(metric: Metric) -> None:
    """E' = fᵀv - e'ᵀDe' + ½ eᵀK'e, E = ½ e'ᵀΛe' + ½ eᵀKe: passive at the hand.

    The last term is the work of a growing stiffness.
    """
    robot, q = panda(), start()
    soft, hard = np.array([200.0, 300.0, 250.0]), np.array([900.0, 500.0, 700.0])
    damping = 30.0
    hand = position_hand(impedance=Impedance(soft, damping=damping))
    controller = Controller(robot, [hand], metric=metric, limits=None)
    controller.at(0.2).ramp(0.3).impedance("hand", Impedance(hard, damping=damping))
    push = Push("panda_tcp", FORCE, duration=10.0)
    plant = RigidBody(pushes=[push]).build(robot, PRECISE)
    log = hsp.simulate(
        controller, q, plant=plant, duration=0.6, log_period=0.002, integrator=PRECISE
    )
    e, rate = log["task.hand.error"], log["task.hand.error_rate"]
    s = np.clip((log.t - 0.2) / 0.3, 0.0, 1.0)
    grown = s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    grows = 30.0 * s**2 * (1.0 - s) ** 2 / 0.3
    K = soft + grown[:, None] * (hard - soft)
    K_dot = grows[:, None] * (hard - soft)
    kinetic = [0.5 * r @ inertia(x, 3) @ r for x, r in zip(log.q, rate, strict=True)]
    energy = np.array(kinetic) + 0.5 * (K * e**2).sum(axis=1)
    power = -rate @ FORCE - damping * (rate**2).sum(axis=1)
    ramped = 0.5 * (K_dot * e**2).sum(axis=1)
    assert simpson(ramped, x=log.t) > 0.02  # it is active
    gained = simpson(power + ramped, x=log.t)
    assert energy[-1] - energy[0] == pytest.approx(gained, rel=1e-6)


@pytest.mark.parametrize(
    "damping", [{"damping_ratio": 0.7}, *further({"damping": 40.0})], ids=repr
)
def test_a_stiffness_that_changes_adds_no_energy(damping: dict[str, float]) -> None:
    """The stiffness of a displaced hand waits; after the release it grows with motion.

    E(t) - E(0) <= ∫ fᵀx' at all times, where efforts are held for a period.
    """
    hand = position_hand(impedance=Impedance(200.0, **damping))
    controller = Controller(panda(), [hand], metric=MassMatrixMetric(), limits=None)
    hard = Impedance(1000.0, **damping)
    controller.at(1.5).ramp(0.2).impedance("hand", hard)
    force = np.array([0.0, 20.0, 0.0])
    push = Push("panda_tcp", force, duration=2.5)
    log = hsp.simulate(
        controller,
        start(),
        plant=RigidBody(pushes=[push]),
        duration=3.5,
        control_period=1e-3,
        log_period=0.01,
        integrator=Rk4(1e-3),
    )
    t, K = log.t, log["task.hand.stiffness"]
    e, rate = log["task.hand.error"], log["task.hand.error_rate"]
    held = (t > 1.6) & (t < 2.5)
    assert np.abs(rate[held][-1]).max() < 1e-3
    assert K[held].max() < 260.0  # the ramp would be over at 1.7
    assert K[-1] == pytest.approx([1000.0] * 3)
    assert (np.diff(K[:, 0]) >= 0.0).all()
    kinetic = [0.5 * r @ inertia(x, 3) @ r for x, r in zip(log.q, rate, strict=True)]
    energy = np.array(kinetic) + 0.5 * (K * e**2).sum(axis=1)
    power = np.where(t[:, None] < 2.5, -rate * force, 0.0).sum(axis=1)
    came = np.concatenate([[0.0], np.cumsum(0.005 * (power[1:] + power[:-1]))])
    assert (energy <= came + 2e-3).all()  # of 1 J
    assert energy.max() > 0.9
    # A change as a function of time alone would add 4 J.
    moved = e[int(2.4 / 0.01)]
    assert 0.5 * (1000.0 - 200.0) * moved @ moved > 3.0
    assert np.abs(np.diff(log.tau, axis=0)).max() < 4.0  # in 10 ms; 3.5 by the force


def test_at_its_target_a_hand_becomes_stiffer_at_once_and_copies_wait_alike() -> None:
    hand = position_hand(impedance=Impedance(200.0))
    controller = Controller(panda(), [hand], limits=None)
    controller.at(0.1).ramp(0.2).impedance("hand", Impedance(1000.0))
    q, v = start(), np.zeros(7)
    for k in range(310):
        controller.applied(controller.compute(1e-3 * k, q, v).tau, 1e-3)
    assert np.diag(controller.stiffness("hand")) == pytest.approx([1000.0] * 3)
    away = panda().integrate(q, np.full(7, 0.05))
    controller.at(0.4).ramp(0.1).impedance("hand", Impedance(2000.0))
    for k in range(310, 600):
        controller.applied(controller.compute(1e-3 * k, away, v).tau, 1e-3)
    assert np.diag(controller.stiffness("hand")) == pytest.approx([1000.0] * 3)
    other = pickle.loads(pickle.dumps(controller))
    for k in range(600, 1400):
        for each in (controller, other):
            each.applied(each.compute(1e-3 * k, q, v).tau, 1e-3)
        np.testing.assert_array_equal(
            other.stiffness("hand"), controller.stiffness("hand")
        )
    assert np.diag(controller.stiffness("hand")) == pytest.approx([2000.0] * 3)
    with pytest.raises(ControllerError, match="'posture' has gains, and no stiffness"):
        Controller(panda(), [hsp.JointPosture()]).stiffness("posture")


CARTESIAN = "compliance/panda_cartesian_impedance"
COARSE = "simulation.control_period=0.002"


@cache
def cartesian() -> Rollout:
    return hsp.load_experiment(CARTESIAN).run()


def test_limits_with_an_observer_stay_inactive_under_a_push() -> None:
    """The robot's own limits are not reached: they include the push."""
    log = cartesian()
    early = log.t < 2.5
    assert not log["status"].any()
    assert log["null_space_norm"][early & (log.t > 0.5)].max() < 0.002
    away = np.abs(log["task.hand.error"][early, 1])
    assert away.max() == pytest.approx(0.05, rel=0.02)
    untold = hsp.load_experiment(
        CARTESIAN,
        COARSE,
        "simulation.duration=1.5",
        "compensation.momentum_observer=null",
    ).run()
    assert (untold["status"] >= 2).any()


# --- the observer's estimate ---------------------------------------------------------


def test_the_observer_finds_the_force_and_does_not_fight_it() -> None:
    """A known wrench is estimated at 1 kHz; the hand moves as without an observer."""
    push = Push("panda_tcp", FORCE, MOMENT, duration=10.0)
    how: dict[str, Any] = {
        "duration": 1.5, "control_period": 0.001, "integrator": Rk4(0.001), "gain": 5.0,
    }  # fmt: skip
    hand = pose_hand(impedance=POSE)
    only = Compensation(momentum_observer=MomentumObserver(60.0, cancel=False))
    seen = run(hand, MassMatrixMetric(), [push], compensation=only, **how)
    alone = run(hand, MassMatrixMetric(), [push], **how)
    np.testing.assert_array_equal(seen.q, alone.q)
    found = seen["observer.wrench.hand"]
    about = seen.meta["columns"]["observer.wrench.hand"]
    assert about["unit"] == "N and N·m"
    settled = seen.t > 0.3
    wrench = np.concatenate([FORCE, MOMENT])
    assert np.abs(found[settled] - wrench).max() < 0.15  # still moving
    assert np.abs(found[-1] - wrench).max() < 1e-3
    # A low-pass of the truth: 1 - exp(-K_O t).
    early = seen.t < 0.1
    low_pass = 1.0 - np.exp(-60.0 * seen.t[early])
    assert np.abs(found[early] - low_pass[:, None] * wrench).max() < 0.5


# --- the rate ------------------------------------------------------------------------


def stiff(impedance: Impedance) -> Controller:
    return Controller(panda(), [position_hand(impedance=impedance)], limits=None)


@pytest.mark.parametrize("kind", ["impedance", "gains", "null_space_gain", "add"])
def test_a_change_that_the_period_does_not_bear_is_refused_while_it_runs(
    kind: str,
) -> None:
    """Just below the advised gain the loop converges, just above it diverges."""
    robot, q, v, h = panda(), panda().home(), np.zeros(7), 0.001
    spring = Impedance(400.0) if kind == "impedance" else None
    controller = Controller(robot, [position_hand(impedance=spring)], limits=None)
    controller.applied(controller.compute(0.0, q, v).tau, h)
    before = controller.compute(0.0, q, v).tau

    def make(scale: float) -> None:
        begin = controller.at(0.001).ramp(0.0)
        if kind == "impedance":
            begin.impedance("hand", Impedance(scale**2 * 4e6))
        elif kind == "gains":
            begin.gains("hand", hsp.Gains(natural_frequency=scale * 4000.0))
        elif kind == "null_space_gain":
            begin.null_space_gain(scale * 4000.0)
        else:
            gains = hsp.Gains(natural_frequency=scale * 4000.0)
            joints = ["panda_joint1"]
            begin.add(hsp.JointPosture(joints=joints, gains=gains, name="added"))

    with pytest.raises(hsp.errors.UnstableRateError, match="unstable") as caught:
        make(1.0)
    np.testing.assert_array_equal(controller.compute(0.0, q, v).tau, before)
    assert not controller.changes
    text = str(caught.value)
    if kind == "impedance":
        assert "impedance: this impedance of task 'hand', held for 0.001 s" in text
        most = float(text.split("this stiffness and ")[1].split(" times")[0])
    elif kind == "null_space_gain":
        most = float(text.split("less than ")[1].split(" 1/s")[0]) / 4000.0
    else:
        most = float(text.split("at most ")[1].split(" times")[0])
    with pytest.raises(hsp.errors.UnstableRateError):
        make(1.01 * most)
    make(0.999 * most)
    assert len(controller.changes) == 1


def test_a_stiffness_of_any_size_is_refused_with_advice() -> None:
    controller = stiff(Impedance(400.0))
    state = panda().home(), np.zeros(7)
    controller.applied(controller.compute(0.0, *state).tau, 0.001)
    for stiffness in (1e8, 1e16, 1e24):
        with pytest.raises(hsp.errors.UnstableRateError, match="needs at most"):
            controller.at(0.0).impedance("hand", Impedance(stiffness))


@pytest.mark.parametrize("seed", range(20))
def test_the_radius_of_held_gains_is_that_of_the_loop_and_of_its_closed_form(
    seed: int,
) -> None:
    """x'' = -kp x - kv x' held for h is stable if and only if kv h < 2, kp h < 2 kv."""
    rng = np.random.default_rng(seed)
    m, h = int(rng.integers(1, 7)), float(10.0 ** rng.uniform(-4, -1))
    kv = rng.uniform(0.1, 2.5, size=m) / h
    kp = rng.uniform(0.1, 2.5, size=m) * kv / h
    T = rng.normal(size=(m, m)) + 3.0 * np.eye(m)
    Kp, Kv = (T @ np.diag(k) @ np.linalg.inv(T) for k in (kp, kv))
    radius = held_radius(Kp, Kv, h)
    assert (radius < 1.0) == bool(((kv * h < 2.0) & (kp * h < 2.0 * kv)).all())
    loop = LinearLoop(Kp, Kv, np.zeros((m, m)), h)
    assert radius == pytest.approx(loop.radius(), rel=1e-6)


# --- the configurations --------------------------------------------------------------


def at(log: Rollout, column: str, t: float) -> Array:
    return log[column][np.searchsorted(log.t, t - 1e-9)]


def test_the_cartesian_configuration_makes_its_point() -> None:
    log = cartesian()
    assert log.status == "completed"
    assert not log["status"].any()
    np.testing.assert_allclose(
        at(log, "task.hand.error", 1.99)[:3], [0.0, -0.05, 0.0], atol=1e-4
    )
    np.testing.assert_allclose(
        at(log, "observer.wrench.hand", 1.99), [0, 30, 0, 0, 0, 0], atol=0.05
    )
    assert at(log, "task.hand.error", 7.49)[1] == pytest.approx(-0.2, abs=2e-3)
    norm = log["null_space_norm"]
    elbow = (log.t >= 3.5) & (log.t < 5.0)
    assert norm[elbow].max() > 0.5
    assert norm[~elbow].max() < 0.01 * norm[elbow].max()


def test_the_joint_configuration_makes_its_point() -> None:
    """Efforts at the sprung joints do not move the free one; a push at it does."""
    experiment = hsp.load_experiment("compliance/panda_joint_impedance", COARSE)
    log = experiment.run()
    assert log.status == "completed"
    assert not log["status"].any()
    error = at(log, "task.joints.error", 1.49)
    force = np.array([300.0, 300, 300, 100, 60, 20]) * error
    state = experiment.robot.state(1.49, at(log, "q", 1.49), np.zeros(7))
    J = np.delete(state.frame("panda_tcp").jacobian[:3], 2, axis=1)
    np.testing.assert_allclose(-force, J.T @ [0.0, 0.0, -30.0], atol=0.1)
    assert np.abs(log["task.joints.error"][-1]).max() < 1e-3
    norm, elbow = log["null_space_norm"], log.q[:, 2]
    pushed = (log.t >= 2.5) & (log.t < 2.9)
    assert norm[log.t < 2.5].max() < 0.002 * norm[pushed].max()
    assert norm[-1] < 1e-4 * norm[pushed].max()
    assert np.ptp(elbow) > 0.05
    assert abs(elbow[-1] - elbow[0]) < 0.02 * np.ptp(elbow)
