"""A compliant hand along whole motions: what a force does to it, and what it does not.

The law runs in the integrator's stages, so that what is compared are the equations
themselves; where efforts are held, the difference is said.
"""

import pickle
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import simpson
from scipy.linalg import sqrtm

import hsp_control as hsp
from hsp_control import Controller, FramePose, FramePosition, Robot, Rollout
from hsp_control.common.exceptions import ControllerError
from hsp_control.control.compensation import Compensation, MomentumObserver, check_rate
from hsp_control.control.compensation.linear_loop import LinearLoop
from hsp_control.control.gains_in_force import dissipated, held_radius, spring_energy
from hsp_control.null_space.metrics import IdentityMetric, MassMatrixMetric, Metric
from hsp_control.robot.integrators import Dop853, Rk4
from hsp_control.simulation.plants import Push, RigidBody
from hsp_control.tasks import Impedance
from hsp_control.tasks.task import ErrorPart

Array = NDArray[np.float64]

PRECISE = Dop853(rtol=1e-11, atol=1e-11)
FORCE, MOMENT = np.array([25.0, -15.0, 20.0]), np.array([1.5, -1.0, 0.7])
POSE = Impedance([500, 700, 600, 25, 30, 20], damping_ratio=0.8)


@cache
def panda() -> Robot:
    return Robot.load("panda")


def start() -> Array:
    return panda().integrate(panda().home(), 0.1 * np.cos(1.0 + np.arange(7)))


def position_hand(**fields: Any) -> FramePosition:
    return FramePosition("panda_tcp", name="hand", largest_error="none", **fields)


def pose_hand(**fields: Any) -> FramePose:
    return FramePose("panda_tcp", name="hand", largest_error="none", **fields)


def run(
    hand: hsp.Task, metric: Metric, pushes: list[Push], gain: float = 3.0, **how: Any
) -> Rollout:
    """Return a run from rest, its null space off its field; nobody tells of pushes."""
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

    It is so for gains as for an impedance. With W = I the same force is felt.
    """
    hand, push = CASES[name]
    pushed = run(hand, MassMatrixMetric(), [push])
    predicted = pushed["null_space_norm"][0] * np.exp(-3.0 * pushed.t)
    assert predicted[0] > 0.05
    assert np.abs(pushed["task.hand.error"]).max() > 0.02  # the hand gives way
    np.testing.assert_allclose(pushed["null_space_norm"], predicted, rtol=1e-8)
    felt = run(hand, IdentityMetric(), [push])
    predicted = felt["null_space_norm"][0] * np.exp(-3.0 * felt.t)
    assert (felt["null_space_norm"] / predicted).max() > 3.0


def test_a_force_elsewhere_does_reach_it() -> None:
    """At the elbow it must: the elbow is what the null space moves."""
    elbow = Push("panda_link4", FORCE, duration=10.0)
    pushed = run(pose_hand(impedance=POSE), MassMatrixMetric(), [elbow])
    predicted = pushed["null_space_norm"][0] * np.exp(-3.0 * pushed.t)
    assert (pushed["null_space_norm"] / predicted).max() > 2.0


def test_a_moment_is_a_force_elsewhere_for_a_position() -> None:
    """The rows of a position do not hold it: a pose keeps it from the null space."""
    turned = Push("panda_tcp", moment=MOMENT, duration=10.0)
    hand = position_hand(impedance=Impedance(600.0))
    pushed = run(hand, MassMatrixMetric(), [turned])
    predicted = pushed["null_space_norm"][0] * np.exp(-3.0 * pushed.t)
    assert (pushed["null_space_norm"] / predicted).max() > 1.5


# --- the spring ----------------------------------------------------------------------


@pytest.mark.parametrize("metric", [IdentityMetric(), MassMatrixMetric()], ids=repr)
def test_under_a_constant_force_the_hand_rests_where_the_spring_holds_it(
    metric: Metric,
) -> None:
    """x - x_d = K⁻¹ f, for a matrix as well; a moment turns it about its own axes."""
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


def test_a_bounded_spring_pulls_no_harder() -> None:
    """At four times its largest error the hand feels the same force: it creeps on."""
    stiffness, bound, damping = 500.0, 0.02, 80.0
    spring = Impedance(stiffness, damping=damping, largest_error=bound)
    push = Push("panda_tcp", [0.0, 0.0, -16.0], duration=10.0)
    slow = run(position_hand(impedance=spring), MassMatrixMetric(), [push], gain=5.0)
    error, rate = slow["task.hand.error"][:, 2], slow["task.hand.error_rate"][:, 2]
    assert error[-1] > 3.0 * bound
    # What is left of the force moves the damper: 16 N - 10 N over 80 N·s/m, but for
    # the change of the inertia along the way.
    np.testing.assert_allclose(rate[-5:], 6.0 / damping, rtol=0.05)


def inertia(q: Array, rows: int) -> Array:
    state = panda().state(0.0, q, np.zeros(7))
    J = state.frame("panda_tcp").jacobian[:rows]
    return np.linalg.inv(J @ np.linalg.solve(state.mass_matrix, J.T))


@pytest.mark.parametrize("metric", [IdentityMetric(), MassMatrixMetric()], ids=repr)
def test_the_energy_is_what_came_in_less_what_was_damped(metric: Metric) -> None:
    """E' = fᵀv - e'ᵀDe' + ½ eᵀK'e, E = ½ e'ᵀΛe' + ½ eᵀKe: passive at the hand.

    The last term is what a growing stiffness adds.
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
        controller, q, plant=plant, duration=0.8, log_period=0.001, integrator=PRECISE
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
    assert simpson(ramped, x=log.t) > 0.02  # it counts
    gained = simpson(power + ramped, x=log.t)
    assert energy[-1] - energy[0] == pytest.approx(gained, rel=1e-6)


@pytest.mark.parametrize(
    "damping", [{"damping": 40.0}, {"damping_ratio": 0.7}], ids=repr
)
def test_a_stiffness_that_changes_adds_no_energy(damping: dict[str, float]) -> None:
    """Held away by a force, the hand waits; let go, it becomes stiffer as it moves.

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
        duration=4.5,
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
    # The change as a function of time alone would have added 4 J.
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


def test_a_hand_that_is_held_becomes_softer_at_once() -> None:
    """A stiffening that waits delays no other change, and nothing piles up."""
    hand = position_hand(impedance=Impedance(600.0))
    controller = Controller(panda(), [hand], limits=None)
    controller.at(0.2).ramp(0.3).impedance("hand", Impedance(2000.0))
    q, v = start(), np.zeros(7)
    away = panda().integrate(q, np.full(7, 0.05))
    controller.compute(0.0, q, v)

    def hold(begin: float, end: float) -> Array:
        for t in np.arange(begin, end, 1e-3):
            controller.applied(controller.compute(t, away, v).tau, 1e-3)
        return np.diag(controller.stiffness("hand"))

    assert hold(0.001, 3.0) == pytest.approx([600.0] * 3)
    controller.at(3.0).ramp(0.3).impedance("hand", Impedance(60.0))
    assert hold(3.0, 6.0) == pytest.approx([60.0] * 3)
    for _ in range(3):  # all else goes on
        controller.at(6.0).ramp(0.1).null_space_gain(5.0)
    hold(6.0, 8.0)
    assert len(controller._time_line.open) == 0


@pytest.mark.parametrize("seed", range(20))
def test_the_power_of_the_damping_is_that_of_the_gains(seed: int) -> None:
    """e'ᵀ(D + D_ζ) e' from the modes, and from D_ζ = 2 ζ Λ √(Λ⁻¹K)."""
    rng = np.random.default_rng(seed)
    m = rng.integers(1, 7)
    A, B, C = rng.normal(size=(3, m, m))
    K, D = A @ A.T + np.eye(m), B @ B.T + np.eye(m)
    G, rate = C @ C.T + 0.1 * np.eye(m), rng.normal(size=m)
    D_ratio = 1.4 * np.linalg.inv(G) @ sqrtm(G @ K)
    for impedance, damping in (
        (Impedance(K, damping=D), D),
        (Impedance(K, damping_ratio=0.7), D_ratio.real),
    ):
        parts = [ErrorPart("joints", "rad", "rad/s", int(m))]
        power = dissipated(impedance.numbers(parts), G, rate)
        assert power == pytest.approx(rate @ damping @ rate, rel=1e-8)


def test_the_spring_s_energy_is_the_integral_of_its_force() -> None:
    spring = Impedance([200.0, 300.0], largest_error=[0.1, 0.2])
    for e in (np.array([0.05, -0.1]), np.array([0.3, -0.5])):
        s = np.linspace(0.0, 1.0, 20001)[:, None]
        force = np.array([200.0, 300.0]) * np.clip(s * e, [-0.1, -0.2], [0.1, 0.2])
        work = simpson(force @ e, x=s[:, 0])
        numbers = spring.numbers([ErrorPart("position", "m", "m/s", 2)])
        assert spring_energy(numbers, np.array([2]), e) == pytest.approx(work, rel=1e-6)


def test_limits_that_an_observer_tells_are_not_bound_by_a_push() -> None:
    """The robot's own limits, far from being reached: they know that it is pushed."""
    configuration = "compliance/panda_cartesian_impedance"
    log = hsp.load_experiment(configuration, "simulation.duration=2.5").run()
    assert not log["status"].any()
    assert log["null_space_norm"][log.t > 0.5].max() < 0.002
    assert np.abs(log["task.hand.error"][:, 1]).max() == pytest.approx(0.05, rel=0.02)
    untold = hsp.load_experiment(
        configuration, "simulation.duration=2.5", "compensation.momentum_observer=null"
    ).run()
    assert (untold["status"] >= 2).any()


# --- what the observer says ----------------------------------------------------------


def test_the_observer_finds_the_force_and_does_not_fight_it() -> None:
    """A known wrench is found at 1 kHz, and the hand moves as without an observer."""
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


def test_a_position_sees_the_force_that_moves_it() -> None:
    push = Push("panda_tcp", FORCE, duration=10.0)
    only = Compensation(momentum_observer=MomentumObserver(60.0, cancel=False))
    hand = position_hand(axes="zx", impedance=Impedance(600.0))
    log = run(
        hand,
        MassMatrixMetric(),
        [push],
        compensation=only,
        duration=1.0,
        control_period=0.001,
        integrator=Rk4(0.001),
    )
    # Of the three components two are rows: f = Λ J M⁻¹ r for these. The estimate of a
    # robot that moves lags by 1/K_O.
    state = panda().state(0.0, log.q[-1], log.v[-1])
    J = state.frame("panda_tcp").jacobian
    rows = J[[2, 0]]
    M_inv = np.linalg.inv(state.mass_matrix)
    expected = np.linalg.solve(rows @ M_inv @ rows.T, rows @ M_inv @ J[:3].T @ FORCE)
    np.testing.assert_allclose(log["observer.wrench.hand"][-1], expected, atol=0.2)
    assert log.meta["columns"]["observer.wrench.hand"]["unit"] == "N"


# --- the rate ------------------------------------------------------------------------


def stiff(impedance: Impedance) -> Controller:
    return Controller(panda(), [position_hand(impedance=impedance)], limits=None)


def test_a_stiffness_that_the_period_does_not_bear() -> None:
    """It is said before the run, and the advice is right."""
    q = panda().home()
    with pytest.raises(
        hsp.errors.UnstableRateError,
        match=r"tasks.hand.impedance: unstable at this rate: √\(stiffness/inertia\) of "
        r"task 'hand' at the start times the period is .*; use at most ([\d.]+) times "
        r"this stiffness and ([\d.]+) times this damping or a control_period",
    ) as caught:
        check_rate(stiff(Impedance(4e6)), q, 0.001)
    text = str(caught.value)
    factor = float(text.split("use at most ")[1].split(" times")[0])
    assert not [
        each
        for each in check_rate(stiff(Impedance(0.999 * factor * 4e6)), q, 0.001)
        if each.unstable
    ]
    (warned,) = check_rate(stiff(Impedance(1e5)), q, 0.001)
    assert warned.path == ("tasks", "hand", "impedance")
    assert "at most 0.2 is recommended: use at most" in warned.message
    assert not check_rate(stiff(Impedance(800.0)), q, 0.001)
    with pytest.raises(hsp.errors.UnstableRateError, match=r"damping/\(2 inertia\) of"):
        check_rate(stiff(Impedance(100.0, damping=8000.0)), q, 0.001)


def test_changes_to_come_are_checked_too() -> None:
    q, soft = panda().home(), Impedance(100.0)
    controller = stiff(soft)
    controller.at(2.0).ramp(0.5).impedance("hand", Impedance(4e6))
    with pytest.raises(
        hsp.errors.UnstableRateError,
        match=r"^changes: .* of task 'hand' from t = 2.5 s on times the period is",
    ):
        check_rate(controller, q, 0.001)
    gains = Controller(panda(), [position_hand()], limits=None)
    gains.at(1.0).ramp(0.0).gains("hand", hsp.Gains(natural_frequency=3000.0))
    with pytest.raises(
        hsp.errors.UnstableRateError,
        match=r"^changes: .*ω0 of task 'hand' from t = 1 s on times the period",
    ):
        check_rate(gains, q, 0.001)


@pytest.mark.parametrize(
    ("spring", "message"),
    [
        (
            Impedance(4e6),
            r"tasks\.hand\.impedance: .*; use at most [\d.]+ times this s",
        ),
        # However far beyond: what is advised is stable.
        (Impedance(600.0, damping=3e6), r"at most [\d.e-]+ times this .* a control_"),
    ],
    ids=["stiffness", "damping"],
)
def test_a_simulation_refuses_what_its_period_does_not_bear(
    spring: Impedance, message: str
) -> None:
    q = panda().home()
    how: dict[str, Any] = {"duration": 0.01, "integrator": Rk4(1e-3)}
    with pytest.raises(hsp.errors.UnstableRateError, match=message):
        hsp.simulate(stiff(spring), q, control_period=1e-3, **how)
    # Without a period nothing is held; and who knows better may say so.
    hsp.simulate(stiff(Impedance(4e6)), q, **how)
    how["check_rate"] = False
    hsp.simulate(stiff(Impedance(4e6)), q, control_period=1e-3, **how)


@pytest.mark.parametrize("kind", ["impedance", "gains", "null_space_gain", "add"])
def test_a_change_that_the_period_does_not_bear_is_refused_while_it_runs(
    kind: str,
) -> None:
    """The advice is right: just below it a loop settles, just above it grows."""
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


def test_the_check_looks_at_the_spring_below_its_bound() -> None:
    """Far from the reference a bounded spring is soft; it will not stay there."""
    robot, q = panda(), panda().home()
    far = hsp.Hold(robot.state(0.0, q, np.zeros(7)).position("panda_tcp") + 0.2)
    bounded = Impedance(4e6, largest_error=1e-4)
    hand = FramePosition("panda_tcp", far, name="hand", impedance=bounded)
    with pytest.raises(hsp.errors.UnstableRateError):
        check_rate(Controller(robot, [hand], limits=None), q, 0.001)


# --- the configurations --------------------------------------------------------------


def at(log: Rollout, column: str, t: float) -> Array:
    return log[column][np.searchsorted(log.t, t - 1e-9)]


def test_the_cartesian_configuration_makes_its_point() -> None:
    log = hsp.load_experiment("compliance/panda_cartesian_impedance").run()
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
    """Efforts at the sprung joints do not reach the free one; a push at it does."""
    experiment = hsp.load_experiment("compliance/panda_joint_impedance")
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
