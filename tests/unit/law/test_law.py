"""The law: pseudo-inverse, equation (13) as printed, and its identities in each metric.

Three oracles: the paper's equation with a (J⁺)' by differences along the motion, the
short form of `oracles.law` in plain NumPy, and the derivative of V itself.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
import oracles
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from law_numbers import Numbers, jacobian, numbers, orthogonal, positive, resolve
from numpy.typing import NDArray
from oracles import slope

from hsp_control import (
    Circle,
    ConstantMetric,
    Controller,
    ControlOutput,
    Cost,
    FrameOrientation,
    FramePosition,
    FunctionField,
    Gains,
    IdentityMetric,
    JointPosture,
    MassMatrixMetric,
    Metric,
    NullSpaceField,
    Robot,
    RobotState,
    TargetPosture,
)
from hsp_control.common.exceptions import MetricError
from hsp_control.law.pseudo_inverse import weighted_pseudo_inverse
from hsp_control.null_space.fields import FieldSample
from hsp_control.null_space.metrics import MetricSample
from hsp_control.null_space.metrics.metric import CONSTANT, IDENTITY, VARYING
from hsp_control.trajectories import HoldOrientation

Array = NDArray[np.float64]

BOUND = np.sqrt(32.0 / 27.0)  # max of s q(s²) threshold, at s = threshold √(2/3)
seeds = st.integers(0, 2**32 - 1)


def pseudo_inverse(J: Array, W: Array | None, threshold: float) -> tuple[Array, bool]:
    """Return the package's J# and whether it was damped; W None: the identity."""
    m, n = J.shape
    form, L = (IDENTITY, np.eye(n)) if W is None else (CONSTANT, np.linalg.cholesky(W))
    B, Q, X = (np.full(shape, np.nan) for shape in ((m, n), (m, n), (m, m)))
    damped = weighted_pseudo_inverse(J, L, form, threshold, B, Q, X)
    return np.linalg.solve(L.T, Q.T @ X), damped


# --- the pseudo-inverse --------------------------------------------------------------


def assert_moore_penrose(J: Array, J_sharp: Array, W: Array, atol: float) -> None:
    """The four axioms, the last in the metric: W J#J is symmetric."""
    n = J.shape[1]
    pairs = [
        (J @ J_sharp @ J, J),
        (J_sharp @ J @ J_sharp, J_sharp),
        (J @ J_sharp, (J @ J_sharp).T),
        (W @ J_sharp @ J, (W @ J_sharp @ J).T),
        # What the law makes of them: W P = PᵀW, J P = 0 and P P = P.
        (J @ (np.eye(n) - J_sharp @ J), np.zeros_like(J)),
    ]
    for actual, expected in pairs:
        np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


@given(seeds, st.integers(1, 8), st.integers(1, 8), st.floats(0.02, 1.0))
def test_moore_penrose_axioms_of_full_rank(
    seed: int, m: int, n: int, least: float
) -> None:
    """Above the threshold J# is the weighted pseudo-inverse, and nothing is damped."""
    assume(m <= n)
    W = positive(seed, n)
    J = jacobian(seed + 2, m, n, np.linspace(1.0, least, m) if m > 1 else least, W)
    J_sharp, damped = pseudo_inverse(J, W, threshold=0.01)
    assert not damped
    # Rounding, grown by the condition numbers of J (50) and of W (100).
    assert_moore_penrose(J, J_sharp, W, atol=1e-11)
    expected = oracles.pseudo_inverse(J, W)
    np.testing.assert_allclose(J_sharp, expected, rtol=0, atol=1e-10)

    J_plus, damped = pseudo_inverse(J, None, threshold=1e-3)
    assert not damped
    np.testing.assert_allclose(J_plus, np.linalg.pinv(J), rtol=0, atol=1e-10)


@given(seeds, st.integers(1, 7), st.data())
def test_moore_penrose_axioms_at_rank_loss(
    seed: int, m: int, data: st.DataObject
) -> None:
    """Rank loss is a special case: zero singular values contribute nothing."""
    n = 7
    rank = data.draw(st.integers(0, m - 1))
    W = positive(seed, n)
    values = np.zeros(m)
    values[:rank] = np.linspace(1.0, 0.2, rank)
    J = jacobian(seed + 2, m, n, values, W)
    J_sharp, damped = pseudo_inverse(J, W, threshold=0.1)
    assert damped
    # A zero that rounding lifts to 1e-16 comes in as 2e-16/threshold².
    assert_moore_penrose(J, J_sharp, W, atol=1e-11)
    L = np.linalg.cholesky(W)
    whitened = np.linalg.pinv(J @ np.linalg.inv(L).T, rcond=1e-9)
    expected = np.linalg.inv(L).T @ whitened
    np.testing.assert_allclose(J_sharp, expected, rtol=0, atol=1e-11)


@pytest.mark.parametrize("shape", [(1, 1), (2, 7), (6, 6)])
@pytest.mark.parametrize("tiny", [0.0, 1e-170, 1e-200, 5e-324])
def test_zero_jacobian(shape: tuple[int, int], tiny: float) -> None:
    """Nothing can be asked of it: J# = 0 (to 2 J/threshold²), damped, and no NaN."""
    J = np.full(shape, tiny)
    J_sharp, damped = pseudo_inverse(J, np.eye(shape[1]), threshold=0.01)
    assert damped
    np.testing.assert_allclose(J_sharp, 0.0, rtol=0, atol=1e-150)


@given(
    seeds,
    st.integers(1, 6),
    st.lists(st.floats(0.0, 3.0), min_size=6, max_size=6),
    st.floats(-4.0, 0.0).map(lambda k: 10.0**k),
)
@example(seed=0, m=3, factors=[1.0] * 6, threshold=0.1)
@example(seed=1, m=1, factors=[np.sqrt(2.0 / 3.0)] * 6, threshold=0.01)
def test_bounded_pseudo_inverse_is_the_function_of_the_spectrum(
    seed: int, m: int, factors: list[float], threshold: float
) -> None:
    """Around the threshold and far below it, against an SVD; ‖J#‖ ≤ 1.09/threshold."""
    n = 7
    W = positive(seed, n)
    values = threshold * np.array(factors[:m])
    J = jacobian(seed + 2, m, n, values, W)
    J_sharp, damped = pseudo_inverse(J, W, threshold)
    expected = oracles.bounded_pseudo_inverse(J, W, threshold)
    np.testing.assert_allclose(J_sharp, expected, rtol=0, atol=1e-11 / threshold)
    L = np.linalg.cholesky(W)
    norm = np.linalg.norm(L.T @ J_sharp, 2)
    assert norm <= (BOUND + 1e-11) / threshold
    assert BOUND < 1.09
    if values.min() < threshold * (1 - 1e-9):
        assert damped
    if values.min() > threshold * (1 + 1e-9):
        assert not damped


def test_bound_is_met() -> None:
    """So 1.0887/threshold is no loose figure: at s = threshold √(2/3)."""
    J = np.zeros((1, 7))
    J[0, 3] = 0.1 * np.sqrt(2.0 / 3.0)
    J_sharp, _ = pseudo_inverse(J, None, threshold=0.1)
    np.testing.assert_allclose(np.linalg.norm(J_sharp), BOUND / 0.1, rtol=1e-14)


@given(
    seeds,
    st.integers(1, 6),
    st.lists(st.floats(0.0, 2.0), min_size=6, max_size=6),
    st.floats(-14.0, -1.0).map(lambda k: 10.0**k),
)
def test_bounded_pseudo_inverse_is_continuous(
    seed: int, m: int, factors: list[float], distance: float
) -> None:
    """‖J1# - J2#‖_F ≤ (2/threshold²) ‖J1 - J2‖_F, in any direction, at any rank.

    2/threshold² is the steepest slope of s q(s²), at s = 0, and a function of a
    symmetric matrix (here of [[0, J], [Jᵀ, 0]]) keeps its Lipschitz constant in the
    Frobenius norm. A jump at the threshold, or at a change of rank, would break it.
    """
    n, threshold = 7, 0.1
    values = threshold * np.array(factors[:m])
    J = jacobian(seed, m, n, values, np.eye(n))
    step = np.random.default_rng(seed).standard_normal((m, n))
    other = J + distance * step / np.linalg.norm(step)
    first, _ = pseudo_inverse(J, None, threshold)
    second, _ = pseudo_inverse(other, None, threshold)
    moved = np.linalg.norm(other - J)
    change = np.linalg.norm(second - first)
    assert change <= 2.0 / threshold**2 * moved + 1e-11


@pytest.mark.parametrize("weighted", [False, True])
def test_smooth_across_the_threshold(weighted: bool) -> None:
    """One singular value crosses it: neither J# nor its slope jumps."""
    n, threshold = 7, 0.05
    W = positive(3, n) if weighted else np.eye(n)

    def at(value: float) -> Array:
        J = jacobian(4, 3, n, [0.7, 0.3, value], W)
        return pseudo_inverse(J, W if weighted else None, threshold)[0]

    h = 1e-5
    below, at_it, above = (at(threshold + k * h) for k in (-1, 0, 1))
    # The jump of the slope, 1/s² against (2 - 3s²/θ²)/θ², is 4h/θ³ at most plus
    # rounding 1e-14/h; a formula that were only continuous would jump by 400.
    jump = (above - at_it) / h - (at_it - below) / h
    assert np.abs(jump).max() < 8 * 10.0 * h / threshold**3
    assert np.abs(above - below).max() > 1e-4  # something does move


@given(seeds, st.lists(st.floats(0.0, 1.5), min_size=3, max_size=3))
def test_freed_directions_pass_to_the_null_space(
    seed: int, factors: list[float]
) -> None:
    """P = I - J#J has the eigenvalues (1 - s²/threshold²)², 0 above it, and ones."""
    n, threshold = 7, 0.1
    W = positive(seed, n)
    values = threshold * np.array(factors)
    J = jacobian(seed + 2, 3, n, values, W)
    J_sharp, _ = pseudo_inverse(J, W, threshold)
    L = np.linalg.cholesky(W)
    P = L.T @ (np.eye(n) - J_sharp @ J) @ np.linalg.inv(L).T  # symmetric
    freed = np.maximum(1.0 - np.array(factors) ** 2, 0.0) ** 2
    expected = np.sort(np.concatenate([freed, np.ones(n - 3)]))
    actual = np.linalg.eigvalsh(0.5 * (P + P.T))
    np.testing.assert_allclose(actual, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(P, P.T, rtol=0, atol=1e-12)


# --- the law on numbers --------------------------------------------------------------


def phi_N(x: Numbers, form: int) -> Array:
    """Return the package's null-space acceleration: what the field adds."""
    return resolve(x, form)[0] - resolve(x, form, controls=False)[0]


FORMS = {"identity": IDENTITY, "constant": CONSTANT, "varying": VARYING}
forms = pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
rows = st.integers(1, 6)


@forms
@given(seeds, rows)
def test_law_equals_its_short_form(form: int, seed: int, m: int) -> None:
    """The compiled law against a dozen lines of NumPy, for random numbers."""
    x = numbers(seed, m, 7, form)
    a, e_N, damped = resolve(x, form)
    expected = oracles.law(*x)
    assert not damped
    # Rounding, grown by cond(W) = 100 and by |W⁻¹| = 10; terms are of order 10.
    np.testing.assert_allclose(e_N, expected.null_space_error, rtol=0, atol=1e-11)
    np.testing.assert_allclose(a, expected.acceleration, rtol=1e-11, atol=1e-10)
    phi = expected.null_space_acceleration
    np.testing.assert_allclose(phi_N(x, form), phi, rtol=1e-11, atol=1e-10)


@forms
@given(seeds, rows)
def test_task_is_met_whatever_the_field_asks(form: int, seed: int, m: int) -> None:
    """J φ_N = 0, J a + J'v = a_x, J e_N = 0: the task never feels the null space."""
    x = numbers(seed, m, 7, form)
    a, e_N, _ = resolve(x, form)
    atol = 1e-12 * max(1.0, np.abs(a).max())
    np.testing.assert_allclose(x.J @ a + x.J_dot @ x.v, x.a_x, rtol=0, atol=atol)
    np.testing.assert_allclose(x.J @ phi_N(x, form), 0.0, rtol=0, atol=atol)
    np.testing.assert_allclose(x.J @ e_N, 0.0, rtol=0, atol=1e-12)


@forms
@given(seeds, rows)
def test_uncontrolled_acceleration_is_the_smallest(
    form: int, seed: int, m: int
) -> None:
    """φ_N = 0: a = J#(a_x - J'v), of least W-norm among all that meet the task."""
    x = numbers(seed, m, 7, form)
    a, _, _ = resolve(x, form, controls=False)
    expected = oracles.pseudo_inverse(x.J, x.W) @ (x.a_x - x.J_dot @ x.v)
    np.testing.assert_allclose(a, expected, rtol=1e-11, atol=1e-11)
    null = np.linalg.svd(x.J)[2][m:]  # rows span the kernel of J
    np.testing.assert_allclose(null @ x.W @ a, 0.0, rtol=0, atol=1e-11)


@forms
@given(seeds, st.integers(2, 6))
def test_law_does_not_depend_on_the_rows(form: int, seed: int, m: int) -> None:
    """J and B(t)J, each with its own rate, are one task: the same a, e_N and φ_N."""
    x = numbers(seed, m, 7, form)
    rng = np.random.default_rng(seed)
    B = orthogonal(seed, m, m) * np.linspace(1.0, 3.0, m)
    B_dot = rng.standard_normal((m, m))
    # (BJv)' = B a_x + B'Jv.
    y = x._replace(
        J=B @ x.J, J_dot=B_dot @ x.J + B @ x.J_dot, a_x=B @ x.a_x + B_dot @ x.J @ x.v
    )
    for first, second in (
        (resolve(x, form)[0], resolve(y, form)[0]),
        (resolve(x, form)[1], resolve(y, form)[1]),
        (phi_N(x, form), phi_N(y, form)),
    ):
        np.testing.assert_allclose(first, second, rtol=1e-10, atol=1e-10)
    # With another's rate the law differs.
    wrong = phi_N(y._replace(J_dot=x.J_dot), form)
    assert np.abs(wrong - phi_N(x, form)).max() > 1e-3


@forms
@given(seeds, st.integers(1, 5), st.data())
def test_redundant_rows_change_nothing(
    form: int, seed: int, m: int, data: st.DataObject
) -> None:
    """A stack of constant rank below its rows: the law of the rows that count.

    The added rows are combinations C of the others, with the accelerations that follow.
    """
    extra = data.draw(st.integers(1, 7 - m))
    x = numbers(seed, m, 7, form)
    C = np.random.default_rng(seed).standard_normal((extra, m))
    stack = np.vstack([np.eye(m), C])
    y = x._replace(J=stack @ x.J, J_dot=stack @ x.J_dot, a_x=stack @ x.a_x)
    a, e_N, damped = resolve(y, form)
    assert damped
    expected, expected_e_N, _ = resolve(x, form)
    # Zeros that rounding lifts to 1e-16 act with 2/threshold² = 2e4, twice at most.
    np.testing.assert_allclose(e_N, expected_e_N, rtol=0, atol=1e-9)
    np.testing.assert_allclose(a, expected, rtol=1e-9, atol=1e-8)


@given(seeds, rows)
def test_constant_metric_is_the_papers_law_in_other_coordinates(
    seed: int, m: int
) -> None:
    """W = AᵀA: a = A⁻¹ a_θ with the law of W = I for θ = A q."""
    x = numbers(seed, m, 7, IDENTITY)
    A = (
        orthogonal(seed + 5, 7, 7)
        * np.linspace(1.0, 3.0, 7)
        @ orthogonal(seed + 6, 7, 7)
    )
    A_inverse = np.linalg.inv(A)
    theta = x._replace(
        J=x.J @ A_inverse,
        J_dot=x.J_dot @ A_inverse,
        v=A @ x.v,
        g=A @ x.g,
        g_dot=A @ x.g_dot,
        K_N=A @ x.K_N @ A_inverse,
    )
    a_theta, e_theta, _ = resolve(theta, IDENTITY)
    metric = ConstantMetric.from_coordinates(A)
    sample = metric.evaluate(None, MetricSample.allocate(7))  # type: ignore[arg-type]
    np.testing.assert_allclose(sample.W, A.T @ A, rtol=0, atol=1e-14)
    a, e_N, _ = resolve(x._replace(W=sample.W), CONSTANT)
    np.testing.assert_allclose(a, A_inverse @ a_theta, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(e_N, A_inverse @ e_theta, rtol=1e-11, atol=1e-11)
    # It is another law than that of W = I.
    assert np.abs(a - resolve(x, IDENTITY)[0]).max() > 1e-6


@given(seeds, rows)
def test_a_scaled_identity_is_the_identity(seed: int, m: int) -> None:
    """The three routes agree where they describe one metric."""
    x = numbers(seed, m, 7, IDENTITY)
    a, e_N, _ = resolve(x, IDENTITY)
    for form in (CONSTANT, VARYING):
        other, other_e_N, _ = resolve(x._replace(W=4.0 * np.eye(7)), form)
        np.testing.assert_allclose(other, a, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(other_e_N, e_N, rtol=1e-12, atol=1e-12)


# --- the law on robots ---------------------------------------------------------------

GAINS = Gains(16.0, 8.0)


@cache
def load(name: str) -> Robot:
    if name == "panda_fingers":
        return Robot.load("panda", locked={})
    if name not in {"planar3r", "panda"}:
        pytest.importorskip("example_robot_data")
    return Robot.load(name)


class Case(NamedTuple):
    """A robot, its tasks and a field that moves in time."""

    robot: Robot
    tasks: list[Any]
    field: NullSpaceField
    q: Array
    v: Array
    posture: Array


def moving_field(robot: Robot) -> NullSpaceField:
    """Return a nonlinear, time-varying field whose rate is known exactly.

    g_i = sin(2 w_i(q) + t), where w is a joint's rate integrated: only its rate v
    matters. It is written for joints of one freedom; others get sin(t).
    """
    single = np.zeros(robot.nv)
    for joint in robot.joints.values():
        if joint.nv == 1:
            single[joint.idx_v] = 2.0
    phase = np.linspace(0.0, 1.0, robot.nv)

    def angle(state: RobotState) -> Array:
        return single * robot.joint_positions(state.q) + state.t + phase

    def rate(state: RobotState) -> Array:
        return np.cos(angle(state)) * (single * state.v + 1.0)

    return FunctionField(robot, lambda s: np.sin(angle(s)), rate=rate)


def case(name: str) -> Case:
    """Return one of the robots that the law is tried on, at a random state."""
    rng = np.random.default_rng(sum(map(ord, name)))
    circle = Circle([0.4, 0.1, 0.5], 0.1, 2.0, normal=[0.0, 1.0, 1.0])
    if name == "planar3r":
        robot = load("planar3r")
        path = Circle([1.0, 1.0], 1.0, 3.0)
        tasks: list[Any] = [FramePosition(robot, "tip", path, GAINS, axes="xy")]
    elif name == "panda":
        robot = load("panda")
        tasks = [FramePosition(robot, "panda_tcp", circle, GAINS)]
    elif name == "panda_pose":  # six rows in two tasks
        robot = load("panda")
        tasks = [
            FramePosition(robot, "panda_tcp", circle, GAINS),
            FrameOrientation(robot, "panda_tcp", HoldOrientation(np.eye(3)), GAINS),
        ]
    elif name == "panda_fingers":  # one finger mimics the other, both in the task
        robot = load("panda_fingers")
        tasks = [FramePosition(robot, "panda_rightfinger", circle, GAINS)]
    elif name == "tiago_no_hand":  # continuous joints in a chain
        robot = load("tiago_no_hand")
        tasks = [FramePosition(robot, "arm_tool_link", circle, GAINS)]
    else:  # a floating root, as if it were driven
        robot = load("solo12")
        tasks = [
            FramePosition(robot, "FL_FOOT", circle, GAINS),
            FrameOrientation(robot, "base_link", HoldOrientation(np.eye(3)), GAINS),
        ]
    q = robot.random_configuration(rng)
    return Case(
        robot, tasks, moving_field(robot), q, rng.standard_normal(robot.nv), q.copy()
    )


CASES = ("planar3r", "panda", "panda_pose", "panda_fingers", "tiago_no_hand", "solo12")


def coordinates(nv: int) -> Array:
    return np.tril(np.ones((nv, nv)))


METRICS: dict[str, Callable[[int], Metric]] = {
    "identity": lambda nv: IdentityMetric(),
    "diagonal": lambda nv: ConstantMetric(np.linspace(1.0, 5.0, nv)),
    "coordinates": lambda nv: ConstantMetric.from_coordinates(coordinates(nv)),
    "mass_matrix": lambda nv: MassMatrixMetric(),
}


def matrix_gain(nv: int, W: Array) -> Array:
    """Return W⁻¹ K̂ with K̂ symmetric positive definite, far from scalar."""
    return np.linalg.solve(W, 8.0 * positive(11, nv) + 4.0 * np.eye(nv))


class Terms(NamedTuple):
    """What the oracle needs, from the state, tasks, field and metric themselves."""

    J: Array
    J_dot: Array
    W: Array
    W_dot: Array
    g: Array
    g_dot: Array
    a_x: Array


def terms(c: Case, state: RobotState, metric: Metric) -> Terms:
    """Return copies of the law's ingredients at a state."""
    samples = [task.evaluate(state) for task in c.tasks]
    sample = metric.evaluate(state, MetricSample.allocate(c.robot.nv))
    field = c.field.evaluate(
        state, sample, metric.form, FieldSample.allocate(c.robot.nv)
    )
    return Terms(
        np.vstack([s.jacobian for s in samples]),
        np.vstack([s.jacobian_dot for s in samples]),
        sample.W.copy(),
        sample.W_dot.copy(),
        field.g.copy(),
        field.g_dot.copy(),
        np.concatenate([s.acceleration for s in samples]),
    )


def controller(c: Case, metric: Metric, gain: Any) -> Controller:
    return Controller(
        c.robot,
        c.tasks,
        c.field,
        metric=metric,
        null_space_gain=gain,
        # Exact wherever these states are: the mass matrix' whitening makes J large or
        # small by itself.
        singularity_threshold=1e-4,
        base="driven" if c.robot.unactuated else None,
    )


def step_of(v: Array) -> float:
    """Return a step in which the joints together move by 0.001.

    Near a singularity J# bends within 0.01: the differences' error h⁶ f⁽⁷⁾/140 was then
    4e-7 of it on panda_fingers, here 1e-12; rounding is 1e-15 over the step.
    """
    return 0.001 / max(1.0, float(np.abs(v).sum()))


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", METRICS)
def test_controller_applies_the_short_form(name: str, kind: str) -> None:
    """From URDF to acceleration, against the oracle in plain NumPy."""
    c = case(name)
    metric = METRICS[kind](c.robot.nv)
    state = c.robot.state(0.3, c.q, c.v)
    x = terms(c, state, metric)
    K_N = 7.0 * np.eye(c.robot.nv)
    out = controller(c, metric, 7.0).compute(state)
    assert not out.damped
    expected = oracles.law(x.J, x.J_dot, x.a_x, c.v, x.g, x.g_dot, K_N, x.W, x.W_dot)
    # Rounding, grown by J's condition; seen: 2e-14 of a, 1e-13 of e_N.
    size = np.abs(expected.acceleration).max()
    np.testing.assert_allclose(
        out.acceleration, expected.acceleration, rtol=0, atol=1e-12 * size
    )
    np.testing.assert_allclose(
        out.null_space_error, expected.null_space_error, rtol=0, atol=1e-12
    )
    # J a + J'v = a_x: to rounding, whatever the metric's condition.
    residual = x.J @ out.acceleration + x.J_dot @ c.v - x.a_x
    assert np.abs(residual).max() <= 1e-12 * max(size, 1.0)


@pytest.mark.parametrize("name", ["planar3r", "panda", "panda_pose", "tiago_no_hand"])
def test_identity_metric_is_equation_13_as_printed(name: str) -> None:
    """With (J⁺)' by differences along the flow, and a matrix K_N."""
    c = case(name)
    nv = c.robot.nv
    metric, K_N = IdentityMetric(), matrix_gain(nv, np.eye(nv))
    state = c.robot.state(0.3, c.q, c.v)
    x = terms(c, state, metric)
    J_plus_dot = slope(
        lambda s: np.linalg.pinv(terms(c, state.ahead(s), metric).J), step_of(c.v)
    )
    expected = oracles.paper_law(
        x.J, x.J_dot, J_plus_dot, x.a_x, c.v, x.g, x.g_dot, K_N
    )
    ours = controller(c, metric, K_N)
    out = ours.compute(state)
    # The differences' rounding, 1e-12 of (J⁺)'; the turning term itself is of order 1.
    np.testing.assert_allclose(
        out.null_space_error, expected.null_space_error, rtol=0, atol=1e-12
    )
    np.testing.assert_allclose(
        out.acceleration, expected.acceleration, rtol=0, atol=1e-9
    )
    without = oracles.paper_law(
        x.J, x.J_dot, 0 * J_plus_dot, x.a_x, c.v, x.g, x.g_dot, K_N
    )
    assert np.abs(without.acceleration - expected.acceleration).max() > 0.1


@pytest.mark.parametrize("name", ["planar3r", "panda"])
def test_coordinates_metric_is_equation_13_in_those_coordinates(name: str) -> None:
    """θ = A q with the paper's own formula there: J A⁻¹, (J A⁻¹)⁺ and its rate."""
    c = case(name)
    nv = c.robot.nv
    A = coordinates(nv)
    A_inverse = np.linalg.inv(A)
    metric = ConstantMetric.from_coordinates(A)
    state = c.robot.state(0.3, c.q, c.v)
    x = terms(c, state, metric)
    J_plus_dot = slope(
        lambda s: np.linalg.pinv(terms(c, state.ahead(s), metric).J @ A_inverse),
        step_of(c.v),
    )
    theta = oracles.paper_law(
        x.J @ A_inverse,
        x.J_dot @ A_inverse,
        J_plus_dot,
        x.a_x,
        A @ c.v,
        A @ x.g,
        A @ x.g_dot,
        7.0 * np.eye(nv),
    )
    out = controller(c, metric, 7.0).compute(state)
    # 1e-11 of (J⁺)' by differences; A⁻¹ doubles it.
    np.testing.assert_allclose(
        out.acceleration, A_inverse @ theta.acceleration, rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        out.null_space_error, A_inverse @ theta.null_space_error, rtol=0, atol=1e-12
    )
    # A cost's field is raised with the metric: -∇_θ f in the other coordinates.
    robot = c.robot
    cost = TargetPosture(robot, c.posture, weights=2.0)
    sample = metric.evaluate(state, MetricSample.allocate(nv))
    state = robot.state(0.3, robot.integrate(c.q, 0.3 * c.v), c.v)
    g = cost.evaluate(state, sample, metric.form, FieldSample.allocate(nv)).g
    np.testing.assert_allclose(
        A @ g, -A_inverse.T @ cost.gradient(state), rtol=0, atol=1e-13
    )


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", METRICS)
def test_identity_behind_the_short_form(name: str, kind: str) -> None:
    """(J#J'J# + (J#)')J x = P W⁻¹(J'ᵀJ#ᵀW - W'J#J)x, (J#)' by differences."""
    c = case(name)
    metric = METRICS[kind](c.robot.nv)
    state = c.robot.state(0.3, c.q, c.v)
    t = terms(c, state, metric)
    x = t.g - c.v

    def J_sharp_at(s: float) -> Array:
        there = terms(c, state.ahead(s), metric)
        return oracles.pseudo_inverse(there.J, there.W)

    J_sharp, J_sharp_dot = J_sharp_at(0.0), slope(J_sharp_at, step_of(c.v))
    left = (J_sharp @ t.J_dot @ J_sharp + J_sharp_dot) @ t.J @ x
    P = np.eye(c.robot.nv) - J_sharp @ t.J
    bend = t.J_dot.T @ J_sharp.T @ t.W - t.W_dot @ J_sharp @ t.J
    right = P @ np.linalg.solve(t.W, bend @ x)
    # Rounding of the differences, 1e-11, and of W⁻¹: cond(M) is up to 5e6 (Tiago).
    scale = max(1.0, np.abs(left).max()) * (1e-9 + 1e-14 * np.linalg.cond(t.W))
    np.testing.assert_allclose(left, right, rtol=0, atol=scale)
    assert np.abs(left).max() > 0.01  # there is something to see


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", METRICS)
def test_projector_and_error_in_the_metric(name: str, kind: str) -> None:
    """W P = PᵀW, P² = P, P W⁻¹Jᵀ = 0; e_N = P(g - v) and ‖x‖² = ‖e_N‖² + ‖x - e_N‖²."""
    c = case(name)
    metric = METRICS[kind](c.robot.nv)
    state = c.robot.state(0.3, c.q, c.v)
    x = terms(c, state, metric)
    ours = controller(c, metric, 7.0)
    out = ours.compute(state)
    J_sharp, _ = pseudo_inverse(x.J, x.W, threshold=1e-4)
    P = np.eye(c.robot.nv) - J_sharp @ x.J
    atol = 1e-11 * np.linalg.norm(x.W, 2)
    np.testing.assert_allclose(x.W @ P, P.T @ x.W, rtol=0, atol=atol)
    np.testing.assert_allclose(P @ P, P, rtol=0, atol=1e-10)
    np.testing.assert_allclose(P @ np.linalg.solve(x.W, x.J.T), 0.0, rtol=0, atol=1e-8)
    e_N, asked = out.null_space_error, x.g - c.v
    np.testing.assert_allclose(e_N, P @ asked, rtol=0, atol=1e-11)
    np.testing.assert_allclose(x.J @ e_N, 0.0, rtol=0, atol=1e-11)
    rest = asked - e_N
    whole = asked @ x.W @ asked
    np.testing.assert_allclose(e_N @ x.W @ e_N + rest @ x.W @ rest, whole, rtol=1e-10)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("kind", METRICS)
@pytest.mark.parametrize("gain", ["scalar", "matrix"])
def test_lyapunov_function_decays_as_proved(name: str, kind: str, gain: str) -> None:
    """d/dt ½e_NᵀWe_N = -e_NᵀW K_N e_N, by differences of V along the closed loop.

    A curve with the state's velocity and the law's acceleration suffices; V on it comes
    from plain NumPy.
    """
    c = case(name)
    nv = c.robot.nv
    metric = METRICS[kind](nv)
    state = c.robot.state(0.3, c.q, c.v)
    W = terms(c, state, metric).W
    K_N = 7.0 * np.eye(nv) if gain == "scalar" else matrix_gain(nv, W)
    if metric.form == VARYING and gain == "matrix":
        # Asked to be positive definite by itself; the identity holds for any.
        K_N = 8.0 * positive(11, nv) + 4.0 * np.eye(nv)
    out = controller(c, metric, K_N).compute(state)
    a, e_N = out.acceleration.copy(), out.null_space_error.copy()
    elsewhere = RobotState(c.robot)

    def V(s: float) -> float:
        q, v = c.robot.integrate(c.q, s * c.v), c.v + s * a
        x = terms(c, elsewhere.update(0.3 + s, q, v), metric)
        e = (np.eye(nv) - oracles.pseudo_inverse(x.J, x.W) @ x.J) @ (x.g - v)
        return float(0.5 * e @ x.W @ e)

    step = min(step_of(c.v), 0.1 / np.abs(a).max())
    expected = -e_N @ W @ K_N @ e_N
    assert abs(expected) > 0.1  # there is something to see
    # Rounding of the differences: 1e-15 of V over 1e-4 s; seen: 1e-12 of V'.
    np.testing.assert_allclose(slope(V, step), expected, rtol=1e-10)


@pytest.mark.parametrize("kind", METRICS)
def test_law_of_a_rank_deficient_task(kind: str) -> None:
    """The planar arm cannot leave its plane: xyz has rank 2 of 3, for ever.

    The law is exact all the same, and equal to that of xy alone.
    """
    c = case("planar3r")
    metric = METRICS[kind](3)
    space = Circle([1.0, 1.0, 0.0], 1.0, 3.0, axes=np.eye(3)[:2])
    task = FramePosition(c.robot, "tip", space, GAINS)
    state = c.robot.state(0.3, c.q, c.v)
    flat = controller(c, metric, 7.0).compute(state)
    spatial = controller(c._replace(tasks=[task]), metric, 7.0).compute(state)
    assert spatial.damped
    assert not flat.damped
    for name in ("tau", "acceleration", "null_space_error"):
        # A zero row is a zero to the last bit: only rounding differs.
        np.testing.assert_allclose(
            getattr(spatial, name), getattr(flat, name), rtol=1e-12, atol=1e-12
        )


def closed_loop(out: ControlOutput) -> tuple[Array, Array]:
    return out.acceleration.copy(), out.null_space_error.copy()


def test_metrics_differ() -> None:
    """None of the laws compared above is another in disguise."""
    c = case("panda")
    state = c.robot.state(0.3, c.q, c.v)
    laws = [
        closed_loop(controller(c, METRICS[kind](7), 7.0).compute(state))
        for kind in METRICS
    ]
    for i, (a, e_N) in enumerate(laws):
        for b, other in laws[:i]:
            assert np.abs(a - b).max() > 0.1
            assert np.abs(e_N - other).max() > 0.01


def test_a_task_that_takes_every_freedom_leaves_no_null_space() -> None:
    """J square: P = 0, e_N = 0, and the field changes nothing."""
    c = case("panda")
    task = JointPosture(c.robot, c.posture, GAINS)
    state = c.robot.state(0.3, c.q, c.v)
    full = c._replace(tasks=[task])
    for kind in METRICS:
        out = controller(full, METRICS[kind](7), 7.0).compute(state)
        np.testing.assert_allclose(out.null_space_error, 0.0, rtol=0, atol=1e-13)
        expected = task.evaluate(state).acceleration
        np.testing.assert_allclose(out.acceleration, expected, rtol=0, atol=1e-11)


# --- metrics -------------------------------------------------------------------------


def test_mass_matrix_metric() -> None:
    robot = load("panda")
    rng = np.random.default_rng(30)
    state = robot.state(0.0, robot.random_configuration(rng), rng.standard_normal(7))
    sample = MassMatrixMetric().evaluate(state, MetricSample.allocate(7))
    np.testing.assert_array_equal(sample.W, state.mass_matrix)
    np.testing.assert_array_equal(sample.W_dot, state.mass_matrix_rate)
    np.testing.assert_allclose(sample.L @ sample.L.T, sample.W, rtol=0, atol=1e-15)


def test_natural_gradient_descends_where_the_plain_one_need_not() -> None:
    """f' = -‖P W⁻¹∇f‖²_W along v = P g for g = -W⁻¹∇f; with g = -∇f it may rise."""
    robot = load("panda")
    frame = "panda_tcp"
    rng = np.random.default_rng(31)
    cost: Cost = TargetPosture(robot, robot.home())
    metric = MassMatrixMetric()
    rises = 0
    for _ in range(200):
        q = robot.random_configuration(rng)
        state = robot.state(0.0, q, np.zeros(7))
        sample = metric.evaluate(state, MetricSample.allocate(7))
        field = cost.evaluate(state, sample, metric.form, FieldSample.allocate(7))
        gradient = cost.gradient(state)
        J = state.frame(frame).jacobian[:3]
        P = np.eye(7) - oracles.pseudo_inverse(J, sample.W) @ J
        v = P @ field.g
        np.testing.assert_allclose(gradient @ v, -v @ sample.W @ v, rtol=1e-9)
        assert gradient @ v < 0.0
        rises += bool(gradient @ P @ -gradient > 0.0)
    assert rises > 10  # of 200: the reason for raising with the metric


@pytest.mark.parametrize(
    ("W", "message"),
    [
        (np.zeros((2, 3)), r"metric has shape \(2, 3\); needs \(nv, nv\)"),
        (2.0, r"metric has shape \(\)"),
        ([], r"metric has shape \(0, 0\)"),
        (np.zeros((2, 2, 2)), r"metric has shape \(2, 2, 2\)"),
        ([1.0, np.nan], "metric holds a NaN or an infinity"),
        ([1.0, np.inf], "metric holds a NaN or an infinity"),
        ([[1.0, 2.0], [0.0, 1.0]], "metric is not symmetric"),
        ([1.0, -1.0], "not positive definite: its least eigenvalue is -1"),
        ([1.0, 0.0], "not positive definite: its least eigenvalue is 0"),
        (-np.eye(3), "not positive definite: its least eigenvalue is -1"),
        (np.ones((3, 3)), "not positive definite"),
    ],
)
def test_constant_metric_refuses(W: Any, message: str) -> None:
    with pytest.raises(MetricError, match=message):
        ConstantMetric(W)


@given(seeds, st.integers(2, 8))
def test_coordinates_that_are_singular_but_for_rounding(seed: int, n: int) -> None:
    """AᵀA of a singular A has a least eigenvalue of ±1e-16, by the toss of a coin."""
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((n, n - 1)) @ rng.standard_normal((n - 1, n))
    with pytest.raises(MetricError, match="not positive definite"):
        ConstantMetric.from_coordinates(A)
    with pytest.raises(
        MetricError, match=r"coordinates A have shape .*; need \(nv, nv\)"
    ):
        ConstantMetric.from_coordinates(A[:, 1:])


def test_constant_metric_keeps_a_copy() -> None:
    W = np.eye(3)
    metric = ConstantMetric(W)
    W[:] = 0.0
    np.testing.assert_array_equal(metric.W, np.eye(3))
    np.testing.assert_array_equal(ConstantMetric([1.0, 2.0]).W, np.diag([1.0, 2.0]))
