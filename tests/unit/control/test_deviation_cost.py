"""The cost of deviations from the law, and postures within the motors' limits."""

from dataclasses import replace
from typing import Any

import limit_oracle
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from loaded_robots import panda
from places import THOROUGH, covering, further
from runs import held
from static_rows import static_rows

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import StaticEffort
from hsp_control.control.actuation import Status
from hsp_control.control.actuation.deviation_cost import (
    Directions,
    Levels,
    write_directions,
    write_inverse_root,
)
from hsp_control.edge import BoundLaw
from hsp_control.engine.plans import planned

seeds = st.integers(0, 2**32 - 1)
FAR = [0.8, 0.6, 0.9]


def hand(**circle: Any) -> hsp.FramePosition:
    options = {"angular_rate": 2.0, "normal": [0.0, 0.0, 1.0], **circle}
    path = hsp.Circle(0.15, center=[0.45, 0.0, 0.45], **options)
    return hsp.FramePosition("panda_tcp", path, gains=hsp.Gains(natural_frequency=10.0))


METRICS: dict[str, hsp.metrics.Metric] = {
    "identity": hsp.metrics.IdentityMetric(),
    "constant": hsp.metrics.ConstantMetric(
        np.diag([1.0, 2.0, 1.0, 3.0, 1.0, 2.0, 1.0])
    ),
    "mass": hsp.metrics.MassMatrixMetric(),
}


def inverse_cost(law: BoundLaw, held: Array, slack: float) -> Array:
    """Return J Jᵀ, which should equal H⁻¹."""
    levels = Levels.of(law, False, panda().size, held, np.array([slack]))
    directions = Directions.of(7)
    JT, moving = np.zeros((7, 7)), np.zeros(1, dtype=np.int64)
    calls = [
        write_directions(levels, directions),
        write_inverse_root(levels, directions, False, JT, moving),
    ]
    planned(calls).run(0.0)
    assert moving[0] == 7
    return JT.T @ JT


@pytest.mark.parametrize(
    ("threshold", "metric", "levels"),
    covering([1e-3, 0.2, 0.5, 0.999, 1.0, 5.0], METRICS, [1, 3], times=2),
)
@given(seeds)
@settings(max_examples=30 if THOROUGH else 3)
def test_levels_share_directions_as_the_law_does(
    metric: str, threshold: float, levels: int, seed: int
) -> None:
    """J Jᵀ H = 1 with log H from the levels' projectors.

    Of the damped law, of the exact one, where it is resolved, and of any mixture. Also
    where the smallest singular value is slightly above the threshold, or equal to it up
    to rounding: then the spectrum may come from the exact law.
    """
    robot, rng = panda(), np.random.default_rng(seed)
    posture = hsp.JointPosture(robot.home(), joints=["panda_joint2"], priority=2)
    elbow = hsp.FramePosition("panda_link4", hsp.Hold([0.1, 0.2, 0.5]), priority=3)
    state = robot.state(0.1, robot.random_configuration(rng), rng.standard_normal(7))

    def computed(threshold: float, error: Any) -> hsp.Controller:
        controller = hsp.Controller(
            robot,
            [replace(hand(), largest_error=error), posture, elbow][:levels],
            hsp.JointCentering(),
            metric=METRICS[metric],
            limits=None,
            singularity_threshold=threshold,
        )
        controller.compute(state)
        return controller

    if threshold in {0.999, 1.0}:
        values = computed(1e-3, "none").diagnose().singular_values
        assume(values[-1] > 1e-100)  # so that its square does not underflow
        controller = computed(threshold * values[-1], "none")
    else:
        controller = computed(threshold, "robot")
    law = controller._active.law
    planned([law.damped_beside(state.v)]).run(0.0)  # as with an active limit
    # from strict priorities to equal costs
    held = 10.0 ** rng.uniform(-7.0, 1.0, size=levels)
    mixed = law.edge_level[0] > 0 and law.edge.share[0] < 1.0
    for slack in (0.0, rng.uniform(), 1.0) if mixed else (1.0,):
        H = limit_oracle.deviation_cost(law, False, robot.size, held, slack)
        inverse = inverse_cost(law, held, slack)
        np.testing.assert_allclose(inverse @ H, np.eye(7), atol=1e-5)


FIELD = 0.01 * hsp.JointCentering()
"""It demands less than the limits permit at a distance from them."""


def on_springs(limits: hsp.Limits | None, *below: hsp.FramePosition) -> hsp.Controller:
    spring = hsp.FramePosition(
        "panda_tcp", hsp.Hold(FAR), impedance=hsp.Impedance(400.0)
    )
    metric = hsp.metrics.MassMatrixMetric()
    return hsp.Controller(
        panda(), [spring, *below], FIELD, metric=metric, limits=limits
    )


@given(seeds)
@settings(max_examples=20)
def test_springs_yield_as_a_body_with_stops(seed: int) -> None:
    """Only joints at a bound get a reaction, and it leads away from the bound.

    Except for the cost of the null space relative to a spring: at most 1.4e-4 of the
    largest in 400 cases.
    """
    rng, robot = np.random.default_rng(seed), panda()
    q = robot.home() + 0.2 * rng.standard_normal(7)
    state = robot.state(0.0, q, 0.01 * rng.standard_normal(7))
    wanted = on_springs(None).compute(state).acceleration
    bounds = hsp.Limits(acceleration=2.0, effort="none", effort_rate="none")
    got = on_springs(bounds).compute(state).acceleration
    reaction = state.mass_matrix @ (got - wanted)
    at_bound = np.abs(got) > 2.0 - 1e-9
    assert at_bound.any()
    least = 1e-3 * np.abs(reaction).max()
    np.testing.assert_allclose(reaction[~at_bound], 0.0, atol=least)
    assert (reaction[at_bound] * got[at_bound] <= least).all()


def straight_elbow(limits: hsp.Limits | None) -> hsp.Controller:
    """Return a hand's pose above an elbow's position: 9 rows on 7 joints."""
    gains = hsp.Gains(natural_frequency=10.0)
    tasks = [
        hsp.FramePose("panda_tcp", gains=gains),
        hsp.FramePosition("panda_link4", hsp.Hold(), gains=gains, priority=2),
    ]
    home = panda().home()
    field = hsp.TargetPosture("home")
    return hsp.Controller(panda(), tasks, field, limits=limits, start=home)


@pytest.mark.parametrize("limits", [hsp.Limits(), *further(None)])
def test_efforts_are_continuous_near_a_straight_elbow(
    limits: hsp.Limits | None,
) -> None:
    """The elbow opens by 0.4 mrad per step, from 0.55 rad to its limit.

    Efforts change by less than 40 N·m, where directions pass from the hand to the elbow
    and to the null space. And none jumps: the largest change of an effort fades as its
    interval is halved. (It was 174 N·m, whatever the interval.)
    """
    controller, (lower, upper) = straight_elbow(limits), panda().position_limits()

    def effort(angle: float) -> Array:
        q[3] = angle
        tau = controller.compute(0.0, q, v).tau
        # At half a turn from its target an orientation has no error to follow.
        turned = np.linalg.norm(controller._active.rows.error[3:6])
        return tau if turned < 3.1 else np.full(7, np.nan)

    for seed in range(24 if THOROUGH else 12):
        rng = np.random.default_rng(seed)
        q = panda().home() + 0.3 * rng.standard_normal(7)
        q, v = np.clip(q, lower + 0.2, upper - 0.2), 0.2 * rng.standard_normal(7)
        angles = np.arange(-0.55, upper[3] - 0.01, 4e-4)
        efforts = np.array([effort(angle) for angle in angles])
        changes = np.abs(np.diff(efforts, axis=0)).max(axis=1)
        worst = int(np.nanargmax(changes))
        assert changes[worst] < 40.0
        low, high = angles[worst : worst + 2]
        for _ in range(12):
            middle = 0.5 * (low + high)
            parts = [effort(each) for each in (low, middle, high)]
            first, second = np.abs(np.diff(parts, axis=0)).max(axis=1)
            low, high = (low, middle) if first > second else (middle, high)
        assert max(first, second) < 0.02 * changes[worst]


# --- postures within the motors' limits ----------------------------------------------


@pytest.mark.parametrize("locked", [None, {}])  # with {} one finger mimics the other
def test_static_rows_are_the_second_derivative(locked: dict[str, float] | None) -> None:
    """∇G·a + drift = G'' along q + s v + ½ s² a, by differences."""
    robot = panda() if locked is None else hsp.Robot.load("panda", locked=locked)
    n, rng = robot.nv, np.random.default_rng(4)
    effort, share, alpha, h = np.full(n, 20.0), 0.6, 7.0, 1e-3
    limit = StaticEffort(effort, share)
    q, v, a = robot.home(), 0.5 * rng.standard_normal(n), rng.standard_normal(n)
    A, b = static_rows(limit, robot.state(0.0, q, v), alpha)
    assert len(A) > 0

    def room(s: float) -> Array:
        there = robot.integrate(q, s * v + 0.5 * s * s * a)
        still = robot.inverse_dynamics(there, np.zeros(n), np.zeros(n))
        return share - np.abs(still) / effort

    rate = (room(h) - room(-h)) / (2.0 * h)
    second = (room(h) - 2.0 * room(0.0) + room(-h)) / h**2
    barrier = second + 2.0 * alpha * rate + alpha**2 * room(0.0)
    near = np.flatnonzero(share - room(0.0) + 0.5 * np.maximum(-rate, 0.0) > 0.3)
    assert len(near) == len(A)
    np.testing.assert_allclose(A @ a - b, barrier[near], rtol=0, atol=1e-4)


@pytest.mark.slow
def test_an_arm_goes_where_it_can_be_held() -> None:
    """At a target beyond the shoulder's static effort the arm stops before it."""
    robot, used = panda(), {}
    share = 0.35  # of 87 N·m at the shoulder; the stretched arm needs 37
    gains = hsp.Gains(natural_frequency=6.0)
    far = hsp.FramePosition("panda_tcp", hsp.Hold([0.7, 0.0, 0.4]), gains=gains)
    for static in (None, share):
        limits = hsp.Limits(static_effort=static)
        controller = hsp.Controller(robot, [far], limits=limits)
        rollout = held(controller, robot.home(), duration=1.5)
        assert rollout["status"].max() < Status.RELAXED
        still = [robot.inverse_dynamics(q, 0 * q, 0 * q) for q in rollout["q"][::20]]
        used[static] = (np.abs(still) / robot.model.effortLimit).max()
    assert used[None] > share + 0.02
    # The barrier holds up to the error of an acceleration held for 1 ms, over α².
    assert used[share] < share + 1e-3
