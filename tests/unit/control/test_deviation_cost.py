"""How far the null space gives way, and postures that motors can hold."""

from functools import cache
from typing import Any

import limit_oracle
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from hsp_control import (
    Circle,
    Controller,
    FramePose,
    FramePosition,
    Gains,
    Hold,
    JointCentering,
    JointPosture,
    Limits,
    Robot,
    RobotState,
    Rollout,
    TargetPosture,
    simulate,
)
from hsp_control.common.kernels import PLAIN
from hsp_control.constraints.limits import Scaled, StaticEffort
from hsp_control.control import ControlOutput
from hsp_control.control.actuation import Status
from hsp_control.control.actuation.deviation_cost import (
    DecayRate,
    Directions,
    write_directions,
    write_inverse_root,
    write_null_space_rows,
)
from hsp_control.law import Resolution
from hsp_control.null_space.metrics import (
    ConstantMetric,
    IdentityMetric,
    MassMatrixMetric,
    Metric,
)
from hsp_control.robot.integrators import Rk4

Array = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)
NOWHERE = np.zeros(0, dtype=np.int64)
SPEED = 0.4
compiled = pytest.mark.skipif(PLAIN, reason="many steps")


@cache
def panda() -> Robot:
    return Robot.load("panda")


def hand(**circle: Any) -> FramePosition:
    options = {"angular_rate": 2.0, "normal": [0.0, 0.0, 1.0], **circle}
    path = Circle(0.15, center=[0.45, 0.0, 0.45], **options)
    return FramePosition("panda_tcp", path, gains=Gains(natural_frequency=10.0))


METRICS: dict[str, Metric] = {
    "identity": IdentityMetric(),
    "constant": ConstantMetric(np.diag([1.0, 2.0, 1.0, 3.0, 1.0, 2.0, 1.0])),
    "mass": MassMatrixMetric(),
}


def projector(resolution: Resolution) -> Array:
    """Return P, as the rows of the bound have it."""
    directions = Directions.of(resolution, supported=False)
    P = np.zeros((7, 7))
    write_directions(directions)
    write_null_space_rows(directions, P)
    return P


# --- how far the null space gives way ------------------------------------------------


@pytest.mark.parametrize("metric", METRICS)
@given(seeds)
@settings(max_examples=15)
def test_the_bound_leaves_the_law_alone(metric: str, seed: int) -> None:
    """No other limit active: the step is the law's, to the last bit."""
    robot, rng = panda(), np.random.default_rng(seed)
    q, v = robot.random_configuration(rng), 2.0 * rng.standard_normal(7)
    options: dict[str, Any] = {"metric": METRICS[metric]}
    field = JointCentering()
    wide = {"effort": 1e6, "velocity": None, "position": None}
    limits = Limits(**wide, null_space_speed=1e-3)
    state = robot.state(0.3, q, v)
    free = Controller(robot, [hand()], field, **({"limits": None} | options))
    bounded = Controller(robot, [hand()], field, limits=limits, **options)
    law, out = free.compute(state), bounded.compute(state)
    assert out.status == Status.EXACT
    np.testing.assert_array_equal(out.tau, law.tau)


@pytest.mark.parametrize("threshold", [1e-3, 0.999, 5.0])
@pytest.mark.parametrize("metric", METRICS)
@given(seeds)
@settings(max_examples=10)
def test_the_projector_is_the_law_s(metric: str, threshold: float, seed: int) -> None:
    """P(g - v) is the law's own null-space error, to rounding.

    Also where a direction is being lost: then the null space has the share of it that
    the law's e_N keeps. And where the smallest singular value is so little above the
    threshold that the law, which is exact, has to find the spectrum.
    """
    robot, rng = panda(), np.random.default_rng(seed)
    state = robot.state(0.1, robot.random_configuration(rng), rng.standard_normal(7))

    def computed(threshold: float) -> tuple[Controller, ControlOutput]:
        controller = Controller(
            robot,
            [hand()],
            JointCentering(),
            metric=METRICS[metric],
            limits=None,
            singularity_threshold=threshold,
        )
        return controller, controller.compute(state)

    if threshold == 0.999:
        threshold *= computed(1e-3)[0].diagnose().singular_values[-1]
    controller, out = computed(threshold)
    assert bool(out.damped) == (threshold == 5.0)
    P = projector(controller.active_stack.resolution)
    e_N = P @ (out.field.g - state.v)
    np.testing.assert_allclose(e_N, out.null_space_error, rtol=0, atol=1e-9)


@pytest.mark.parametrize("metric", METRICS)
@given(seeds)
@settings(max_examples=10)
def test_the_root_of_the_inverse_cost_is_that(metric: str, seed: int) -> None:
    """J Jᵀ H = 1, with H assembled from singular vectors; so is P."""
    robot, rng = panda(), np.random.default_rng(seed)
    posture = JointPosture(robot.home(), joints=["panda_joint2"], priority=2)
    tasks = [hand(), posture]
    controller = Controller(
        robot, tasks, JointCentering(), metric=METRICS[metric], limits=None
    )
    state = robot.state(0.1, robot.random_configuration(rng), rng.standard_normal(7))
    if controller.compute(state).damped:  # a direction is between two levels
        return
    resolution = controller.active_stack.resolution
    directions, JT = Directions.of(resolution, supported=False), np.zeros((7, 7))
    write_directions(directions)
    assert write_inverse_root(directions, 0, JT) == 7
    H = limit_oracle.deviation_cost(resolution, supported=False)
    np.testing.assert_allclose(JT.T @ JT @ H, np.eye(7), atol=1e-6)
    expected = limit_oracle.null_space_projector(resolution)
    np.testing.assert_allclose(projector(resolution), expected, atol=1e-9)


@pytest.mark.parametrize("threshold", [0.2, 0.5, 5.0])
@pytest.mark.parametrize("metric", METRICS)
@given(seeds)
@settings(max_examples=10)
def test_levels_share_directions_as_the_law_does(
    metric: str, threshold: float, seed: int
) -> None:
    """J Jᵀ H = 1 with log H from the levels' projectors; P is the law's own."""
    robot, rng = panda(), np.random.default_rng(seed)
    posture = JointPosture(robot.home(), joints=["panda_joint2"], priority=2)
    elbow = FramePosition("panda_link4", Hold([0.1, 0.2, 0.5]), priority=3)
    controller = Controller(
        robot,
        [hand(), posture, elbow],
        JointCentering(),
        metric=METRICS[metric],
        limits=None,
        singularity_threshold=threshold,
    )
    state = robot.state(0.1, robot.random_configuration(rng), rng.standard_normal(7))
    out = controller.compute(state)
    resolution = controller.active_stack.resolution
    directions, JT = Directions.of(resolution, supported=False), np.zeros((7, 7))
    write_directions(directions)
    assert write_inverse_root(directions, 0, JT) == 7
    H, P = limit_oracle.shared_cost(resolution)
    np.testing.assert_allclose(JT.T @ JT @ H, np.eye(7), atol=1e-5)
    np.testing.assert_allclose(projector(resolution), P, atol=1e-9)
    e_N = P @ (out.field.g - state.v)
    np.testing.assert_allclose(e_N, out.null_space_error, rtol=0, atol=1e-9)
    # Levels cost whole^t, t = 0, 1/3, 2/3, and the null space whole: it has its share
    # of what costs less than the last level alone.
    t = np.log(directions.root) / np.log(directions.costs[1, -1])
    free = np.clip(3.0 * t - 2.0, 0.0, 1.0)
    np.testing.assert_allclose(directions.share, free, rtol=0, atol=1e-9)


def straight_elbow(limits: Limits | None) -> Controller:
    """Return a hand's pose above an elbow's position: 9 rows on 7 joints."""
    gains = Gains(natural_frequency=10.0)
    tasks = [
        FramePose("panda_tcp", gains=gains),
        FramePosition("panda_link4", Hold(), gains=gains, priority=2),
    ]
    home = panda().home()
    field = TargetPosture("home")
    return Controller(panda(), tasks, field, limits=limits, start=home)


@compiled
@pytest.mark.parametrize("limits", [None, Limits()])
def test_efforts_are_continuous_near_a_straight_elbow(limits: Limits | None) -> None:
    """The elbow opens by 0.4 mrad in a step, from 0.55 rad to its limit.

    Efforts change by less than 40 N·m, where directions pass from the hand to the elbow
    and to the null space. And none jumps: the largest change of an effort fades as its
    interval is halved. (It was 174 N·m, whatever the interval.)
    """
    controller, (lower, upper) = straight_elbow(limits), panda().position_limits()

    def effort(angle: float) -> Array:
        q[3] = angle
        tau = controller.compute(0.0, q, v).tau
        # At half a turn from its target an orientation has no error to follow.
        turned = np.linalg.norm(controller.active_stack.rows.error[3:6])
        return tau if turned < 3.1 else np.full(7, np.nan)

    for seed in range(24):
        rng = np.random.default_rng(seed)
        q = panda().home() + 0.3 * rng.standard_normal(7)
        q, v = np.clip(q, lower + 0.2, upper - 0.2), 0.2 * rng.standard_normal(7)
        angles = np.arange(-0.55, upper[3] - 0.01, 4e-4)
        efforts = np.array([effort(angle) for angle in angles])
        changes = np.abs(np.diff(efforts, axis=0)).max(axis=1)
        worst = int(np.nanargmax(changes))
        assert changes[worst] < 40.0
        low, high = angles[worst : worst + 2]
        for _ in range(8):
            middle = 0.5 * (low + high)
            parts = [effort(each) for each in (low, middle, high)]
            first, second = np.abs(np.diff(parts, axis=0)).max(axis=1)
            low, high = (low, middle) if first > second else (middle, high)
        assert max(first, second) < 0.02 * changes[worst]


@given(seeds)
@settings(max_examples=30)
def test_decay_rate_is_the_least(seed: int) -> None:
    """xᵀW K_N x ≥ λ xᵀW x, met with equality by one x; a scalar gain is its own.

    Also after another gain, and for another metric.
    """
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((5, 5))
    W = root @ root.T + np.eye(5)
    L = np.linalg.cholesky(W)
    decay_rate = DecayRate()
    assert decay_rate.of(3.0 * np.eye(5), L) == 3.0
    half, turn = rng.standard_normal((2, 5, 5))
    # A skew part of W K_N turns e_N, and neither lengthens nor shortens it.
    gain = np.linalg.solve(W, half @ half.T + 0.1 * np.eye(5) + turn - turn.T)
    decay_rate.of(gain, np.eye(5))
    rate = decay_rate.of(gain, L)
    assert decay_rate.of(3.0 * np.eye(5), L) == 3.0
    x = rng.standard_normal((5, 200))
    parts = np.einsum("ik,ik->k", x, W @ gain @ x) / np.einsum("ik,ik->k", x, W @ x)
    assert parts.min() >= rate * (1.0 - 1e-9)
    plain = np.linalg.solve(W, half @ half.T + 0.1 * np.eye(5))
    assert rate == pytest.approx(np.linalg.eigvals(plain).real.min(), rel=1e-6)


def limited(seed: int, **options: Any) -> tuple[Controller, Array]:
    """Return a weak arm that is asked for more than it can do, and a start."""
    robot, rng = panda(), np.random.default_rng(seed)
    limits = Limits(
        effort=Scaled(rng.uniform(0.45, 0.6)),
        velocity=None,
        position=None,
        **options,
    )
    path = Circle(0.2, rng.uniform(4.0, 6.0), [0.45, 0.0, 0.45], normal=[0, 0, 1])
    task = FramePosition("panda_tcp", path, gains=Gains(natural_frequency=10.0))
    field = JointCentering()
    return Controller(robot, [task], field, limits=limits), robot.home()


def run(controller: Controller, q0: Array, duration: float) -> Rollout:
    return simulate(
        controller,
        q0,
        duration=duration,
        control_period=1e-3,
        log_period=1e-3,
        integrator=Rk4(1e-3),
    )


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_null_space_error_stays_bounded(seed: int) -> None:
    """‖e_N‖ ≤ ‖s‖ throughout, and at each step |P δ| ≤ λ s, where limits bind."""
    controller, q0 = limited(seed, null_space_speed=SPEED)
    rollout = run(controller, q0, 0.8)
    assert rollout.meta["status"] == "completed"
    assert rollout["status"].max() == Status.LIMITED
    # Efforts held for 1 ms leave the error half a period behind: λ h / 2 = 0.5 %.
    norm = rollout["null_space_norm"]
    most = max(SPEED * np.sqrt(7.0), norm[0])
    assert norm.max() <= 1.005 * most
    free = Controller(panda(), [controller.tasks[0]], controller.field, limits=None)
    state, binds = RobotState(panda()), False
    for k in np.flatnonzero(rollout["status"] == Status.LIMITED)[::10]:
        state.update(rollout.t[k], rollout["q"][k], rollout["v"][k])
        law = free.compute(state).acceleration.copy()
        delta = controller.compute(state).acceleration - law
        P = projector(free.active_stack.resolution)
        assert np.abs(P @ delta).max() <= 10.0 * SPEED * (1.0 + 1e-6)
        binds = binds or np.abs(P @ delta).max() > 9.9 * SPEED
    assert binds
    loose, _ = limited(seed)
    assert run(loose, q0, 0.8)["null_space_norm"].max() > norm.max() * 1.2


def test_the_bound_gives_way_to_every_limit() -> None:
    """A joint that only a greater deviation keeps from its limit: it is kept."""
    robot = panda()
    q, v = robot.home(), np.zeros(7)
    _, upper = robot.position_limits()
    # The last joint does not move the hand: it is in the null space alone.
    q[6], v[6] = upper[6] - 0.1, 1.5
    outs = []
    for speed in (None, 0.01):
        limits = Limits(effort=1e4, velocity=None, null_space_speed=speed)
        here = robot.state(0.0, q, v).position("panda_tcp").copy()
        task = FramePosition("panda_tcp", Hold(here), gains=Gains(natural_frequency=10))
        controller = Controller(robot, [task], null_space_gain=1.0, limits=limits)
        out = controller.compute(robot.state(0.0, q, v))
        assert out.status == Status.LIMITED
        outs.append(out.acceleration[6])
    most = 100.0 * (0.1 - 0.005) - 20.0 * 1.5
    np.testing.assert_allclose(outs, most, rtol=1e-5)


# --- postures that motors can hold ---------------------------------------------------


def test_static_rows_are_the_second_derivative() -> None:
    """∇G·a + drift = G'' along q + s v + ½ s² a, by differences."""
    robot, rng = panda(), np.random.default_rng(4)
    effort, share, alpha, h = np.full(7, 20.0), 0.6, 7.0, 1e-3
    limit = StaticEffort(effort, share)
    q, v, a = robot.home(), 0.5 * rng.standard_normal(7), rng.standard_normal(7)
    A, b = limit.rows(robot.state(0.0, q, v), alpha, NOWHERE)
    assert len(A) > 0

    def room(s: float) -> Array:
        there = robot.integrate(q, s * v + 0.5 * s * s * a)
        still = robot.inverse_dynamics(there, np.zeros(7), np.zeros(7))
        return share - np.abs(still) / effort

    rate = (room(h) - room(-h)) / (2.0 * h)
    second = (room(h) - 2.0 * room(0.0) + room(-h)) / h**2
    barrier = second + 2.0 * alpha * rate + alpha**2 * room(0.0)
    near = np.flatnonzero(share - room(0.0) + 0.5 * np.maximum(-rate, 0.0) > 0.3)
    assert len(near) == len(A)
    np.testing.assert_allclose(A @ a - b, barrier[near], rtol=0, atol=1e-4)


def test_what_bears_a_contact_is_left_out() -> None:
    robot = panda()
    limit = StaticEffort(np.full(7, 1.0), 1.0)
    state = robot.state(0.0, robot.home(), np.zeros(7))
    A, _ = limit.rows(state, 10.0, NOWHERE)
    fewer, _ = limit.rows(state, 10.0, np.array([1, 3]))
    assert len(A) == len(fewer) + 2


@pytest.mark.slow
def test_an_arm_goes_where_it_can_be_held() -> None:
    """A target that its shoulder cannot hold: it comes to rest before it."""
    robot = panda()
    q0 = robot.home()
    share = 0.35  # of 87 N·m at the shoulder, which takes 37 with the arm stretched
    far = FramePosition(
        "panda_tcp", Hold([0.7, 0.0, 0.4]), gains=Gains(natural_frequency=6.0)
    )
    used = {}
    for static in (None, share):
        limits = Limits(static_effort=static)
        controller = Controller(robot, [far], limits=limits)
        assert controller.limits is not None
        rollout = run(controller, q0, 1.5)
        assert rollout["status"].max() < Status.RELAXED
        held = np.array(
            [robot.inverse_dynamics(q, 0 * q, 0 * q) for q in rollout["q"][::20]]
        )
        used[static] = (np.abs(held) / controller.limits.effort).max()
    assert used[None] > share + 0.02
    # A barrier is kept to the error of an acceleration held for 1 ms, over α².
    assert used[share] < share + 1e-3
