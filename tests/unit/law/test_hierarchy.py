"""Strict priorities: against an oracle of projectors, and along whole motions."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from law_numbers import Numbers, numbers, resolve
from loaded_robots import panda
from runs import check_errors, check_null_space, continuous

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.law import CONSTANT, IDENTITY, VARYING
from hsp_control.trajectories import Circle

FORMS = {"identity": IDENTITY, "constant": CONSTANT, "varying": VARYING}
forms = pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
seeds = st.integers(0, 2**32 - 1)


def lexicographic(x: Numbers, levels: list[int]) -> tuple[Array, Array]:
    """Return a and e_N of ``docs/law.md``, Priorities, by explicit projectors."""
    n, start = len(x.v), 0
    W_inverse = np.linalg.inv(x.W)
    Q, a = W_inverse, np.zeros(n)
    for rows in levels:
        k = slice(start, start + rows)
        J = x.J[k]
        values, U = np.linalg.eigh(J @ Q @ J.T)
        # of order 1; absolute, since a blocked level is only rounding
        kept = values > 1e-6
        G_plus = (U[:, kept] / values[kept]) @ U[:, kept].T
        a = a + Q @ J.T @ G_plus @ (x.a_x[k] - x.J_dot[k] @ x.v - J @ a)
        Q = Q - Q @ J.T @ G_plus @ J @ Q
        start += rows
    P = Q @ x.W
    error = x.g - x.v
    e_N = P @ error
    w = np.linalg.lstsq(x.J.T, x.W @ (error - e_N), rcond=1e-8)[0]
    bend = x.J_dot.T @ w - x.W_dot @ (error - 0.5 * e_N)
    return a + Q @ (x.W @ (x.g_dot + x.K_N @ e_N) - bend), e_N


@pytest.mark.slow
@forms
@given(seeds, st.lists(st.integers(1, 3), min_size=2, max_size=3))
def test_compatible_levels_are_one_stack(
    form: int, seed: int, levels: list[int]
) -> None:
    """Where all tasks can be met, priorities change nothing: to the last bit."""
    x = numbers(seed, sum(levels), 9, form)
    together, apart = resolve(x, form), resolve(x, form, levels=levels)
    for first, second in zip(together, apart, strict=True):
        np.testing.assert_array_equal(first, second)


@pytest.mark.slow
@forms
@given(seeds, st.lists(st.integers(1, 3), min_size=2, max_size=4))
def test_recursion_is_the_stacked_law(form: int, seed: int, levels: list[int]) -> None:
    """The recursion itself, triggered by a redundant singular direction.

    The last level repeats a row of the first, which already fulfils it: nothing
    changes.
    """
    m = sum(levels)
    x = numbers(seed, m, 13, form)
    repeated = x._replace(
        J=np.vstack([x.J, x.J[:1]]),
        J_dot=np.vstack([x.J_dot, x.J_dot[:1]]),
        a_x=np.append(x.a_x, x.a_x[0]),
    )
    a, e_N, _ = resolve(x, form)
    b, other, damped = resolve(repeated, form, levels=[*levels, 1])
    assert damped
    # Rounding, grown by 2/threshold² = 2e4 in the direction that is repeated.
    np.testing.assert_allclose(b, a, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(other, e_N, rtol=1e-9, atol=1e-9)


@pytest.mark.slow
@forms
@given(seeds, st.integers(1, 3), st.integers(1, 3))
def test_conflict_leaves_the_upper_level_exact(
    form: int, seed: int, upper: int, lower: int
) -> None:
    """A lower level contains the upper's rows and others: as the oracle."""
    rng = np.random.default_rng(seed)
    x = numbers(seed, upper + lower, 7, form)
    mix = rng.standard_normal((lower, upper))
    # The first lower row is entirely blocked, with a different command.
    x.J[upper] = mix[0] @ x.J[:upper]
    x.J_dot[upper] = mix[0] @ x.J_dot[:upper]
    a, e_N, damped = resolve(x, form, levels=[upper, lower])
    assert damped
    top = slice(0, upper)
    scale = max(1.0, float(np.abs(a).max()))
    np.testing.assert_allclose(
        x.J[top] @ a + x.J_dot[top] @ x.v, x.a_x[top], rtol=0, atol=1e-10 * scale
    )
    np.testing.assert_allclose(x.J @ e_N, 0.0, rtol=0, atol=1e-9)
    expected, expected_e_N = lexicographic(x, [upper, lower])
    # The blocked row's rounding error (1e-16) is amplified by 2/threshold² = 2e4.
    np.testing.assert_allclose(e_N, expected_e_N, rtol=0, atol=1e-8)
    np.testing.assert_allclose(a, expected, rtol=1e-8, atol=1e-8)


@given(seeds)
def test_priorities_meet_the_stack_where_they_take_over(seed: int) -> None:
    """The acceleration is the same on both sides of the threshold: no jump."""
    x = numbers(seed, 4, 7, IDENTITY)
    threshold = 0.5  # `numbers` gives the stack the singular values 2 ... 0.5
    below, _, damped = resolve(x, IDENTITY, threshold=threshold * 1.0001, levels=[2, 2])
    above, _, exact = resolve(x, IDENTITY, threshold=threshold * 0.9999, levels=[2, 2])
    assert not exact
    # The level's singular value is above the stack's: not damped at all, as a rule.
    atol = 1e-9 if not damped else 1e-2
    np.testing.assert_allclose(below, above, rtol=0, atol=atol)


# --- along motions -------------------------------------------------------------------

GAINS = hsp.Gains(natural_frequency=8.0)


def metric_of(kind: str) -> hsp.metrics.Metric:
    if kind == "mass_matrix":
        return hsp.metrics.MassMatrixMetric()
    return (
        hsp.metrics.IdentityMetric()
        if kind == "identity"
        else hsp.metrics.ConstantMetric(np.arange(1, 8))
    )


def conflicting(kind: str) -> hsp.Controller:
    """Return a hand on a circle, above a conflicting task, and a wrist.

    The second level's x row equals the first's at every state: rank 5 of 6,
    permanently.
    """
    robot = panda()
    circle = Circle(0.1, 1.5, [0.45, 0.0, 0.4], normal=[0.0, 0.0, 1.0])
    hand = hsp.FramePosition("panda_tcp", circle, gains=GAINS, name="hand")
    rival = hsp.FramePosition(
        "panda_tcp", hsp.Hold([0.6]), gains=GAINS, axes="x", name="rival", priority=2
    )
    wrist = hsp.JointPosture(
        robot.home(), gains=GAINS, joints=["panda_joint7"], name="wrist", priority=2
    )
    return hsp.Controller(
        robot,
        [replace(task, largest_error="none") for task in (wrist, hand, rival)],
        2.0 * hsp.JointCentering(),
        null_space_gain=4.0,
        metric=metric_of(kind),
        limits=None,
    )


@pytest.mark.parametrize("kind", ["identity", "constant", "mass_matrix"])
def test_propositions_hold_per_level(kind: str) -> None:
    """Level 1 as if alone; level 2 in its null space; V decays exponentially."""
    controller = conflicting(kind)
    robot = controller.robot
    q, v0 = robot.home(), 0.3 * np.cos(np.arange(7.0))
    rollout = continuous(
        controller, q, v0, tolerance=1e-11, duration=1.0, log_period=0.02
    )
    assert rollout["damped"].all()  # the conflict is there throughout
    check_errors(rollout, 8.0, "hand", "wrist", atol=1e-8)
    assert np.abs(rollout["task.rival.error"][-1]) > 0.03
    check_null_space(rollout, 4.0, least=0.05, rtol=1e-6)
