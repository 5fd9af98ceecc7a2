"""The law and the pseudo-inverse on random numbers, against plain NumPy."""

import numpy as np
import oracles
import pytest
from hypothesis import assume, example, given
from hypothesis import strategies as st
from law_cases import pseudo_inverse
from law_numbers import Numbers, jacobian, numbers, positive, resolve

from hsp_control.common.arrays import Array
from hsp_control.edge import BoundLaw
from hsp_control.engine.plans import planned
from hsp_control.law import CONSTANT, IDENTITY, VARYING, singular_values

seeds = st.integers(0, 2**32 - 1)


def phi_N(x: Numbers, form: int) -> Array:
    """Return the package's null-space acceleration: the field's contribution."""
    return resolve(x, form)[0] - resolve(x, form, controls=False)[0]


FORMS = {"identity": IDENTITY, "constant": CONSTANT, "varying": VARYING}
forms = pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
rows = st.integers(1, 6)


@pytest.mark.slow
@forms
@given(seeds, rows)
def test_law_equals_its_short_form(form: int, seed: int, m: int) -> None:
    """The compiled law against a dozen lines of NumPy, for random numbers."""
    x = numbers(seed, m, 7, form)
    a, e_N, damped = resolve(x, form)
    expected = oracles.law(*x)
    assert not damped
    # Rounding, amplified by cond(W) = 100 and |W⁻¹| = 10; terms are of order 10.
    np.testing.assert_allclose(e_N, expected.null_space_error, rtol=0, atol=1e-11)
    np.testing.assert_allclose(a, expected.acceleration, rtol=1e-11, atol=1e-10)
    phi = expected.null_space_acceleration
    np.testing.assert_allclose(phi_N(x, form), phi, rtol=1e-11, atol=1e-10)


@pytest.mark.slow
@forms
@given(seeds, rows)
def test_task_is_met_for_any_field(form: int, seed: int, m: int) -> None:
    """J φ_N = 0, J a + J'v = a_x, J e_N = 0: no effect of the null space on the
    task."""
    x = numbers(seed, m, 7, form)
    a, e_N, _ = resolve(x, form)
    atol = 1e-12 * max(1.0, np.abs(a).max())
    np.testing.assert_allclose(x.J @ a + x.J_dot @ x.v, x.a_x, rtol=0, atol=atol)
    np.testing.assert_allclose(x.J @ phi_N(x, form), 0.0, rtol=0, atol=atol)
    np.testing.assert_allclose(x.J @ e_N, 0.0, rtol=0, atol=1e-12)


@pytest.mark.slow
@forms
@given(seeds, st.integers(1, 5), st.data())
def test_redundant_rows_change_nothing(
    form: int, seed: int, m: int, data: st.DataObject
) -> None:
    """A stack of constant deficient rank: the law of its independent rows.

    The added rows are combinations C of the others, with consistent accelerations.
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


@forms
@given(seeds, st.integers(1, 10), st.integers(1, 10))
def test_singular_values_of_stacks_of_any_shape(
    form: int, seed: int, m: int, rank: int
) -> None:
    """Also with more rows than joints, and of any rank."""
    x, rng = numbers(seed, 6, 7, form), np.random.default_rng(seed)
    J = rng.standard_normal((m, rank)) @ rng.standard_normal((rank, 7))
    law = BoundLaw([m], 7, form, x.K_N, 0.01)
    law.problem.task.jacobian[:] = J
    law.problem.metric.W[:] = x.W
    law.problem.metric.L[:] = np.linalg.cholesky(x.W)
    law.null_space_error[:] = x.g
    call, triangle, length = law.diagnosis(0)
    determinant = planned([call]).run(0.0)
    expected = np.linalg.svd(J @ np.linalg.inv(np.linalg.cholesky(x.W)).T)[1]
    np.testing.assert_allclose(
        singular_values(triangle.tobytes()), expected, rtol=0, atol=1e-13 * expected[0]
    )
    # The error of any singular value is a few roundings of the largest one.
    error = 1e-14 * expected[0]
    most, least = np.prod((expected + error) ** 2), np.prod((expected - error) ** 2)
    assert (least if expected[-1] > error else 0.0) <= determinant <= most
    np.testing.assert_allclose(length, np.sqrt(x.g @ x.W @ x.g), rtol=1e-13)


BOUND = np.sqrt(32.0 / 27.0)  # max of s q(s²) threshold, at s = threshold √(2/3)


def assert_moore_penrose(J: Array, J_sharp: Array, W: Array, atol: float) -> None:
    """The four axioms, the last in the metric: W J#J is symmetric."""
    n = J.shape[1]
    pairs = [
        (J @ J_sharp @ J, J),
        (J_sharp @ J @ J_sharp, J_sharp),
        (J @ J_sharp, (J @ J_sharp).T),
        (W @ J_sharp @ J, (W @ J_sharp @ J).T),
        # The law's projector: W P = PᵀW, J P = 0 and P P = P.
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
    # A zero that rounding lifts to 1e-16 contributes 2e-16/threshold².
    assert_moore_penrose(J, J_sharp, W, atol=1e-11)


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
