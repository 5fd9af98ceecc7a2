"""Check the law on random numbers against its short form in plain NumPy."""

import numpy as np
import oracles
import pytest
from hypothesis import given
from hypothesis import strategies as st
from law_numbers import Numbers, numbers, orthogonal, resolve

from hsp_control.common.arrays import Array
from hsp_control.law import CONSTANT, IDENTITY, VARYING, Resolution, singular_values
from hsp_control.null_space.metrics import CoordinatesMetric, MetricSample

seeds = st.integers(0, 2**32 - 1)


def phi_N(x: Numbers, form: int) -> Array:
    """Return the package's null-space acceleration: what the field adds."""
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
    # Rounding, grown by cond(W) = 100 and by |W⁻¹| = 10; terms are of order 10.
    np.testing.assert_allclose(e_N, expected.null_space_error, rtol=0, atol=1e-11)
    np.testing.assert_allclose(a, expected.acceleration, rtol=1e-11, atol=1e-10)
    phi = expected.null_space_acceleration
    np.testing.assert_allclose(phi_N(x, form), phi, rtol=1e-11, atol=1e-10)


@pytest.mark.slow
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


@pytest.mark.slow
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


@pytest.mark.slow
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
    metric = CoordinatesMetric(A)
    sample = metric.evaluate(None, MetricSample.allocate(7))  # type: ignore[arg-type]
    np.testing.assert_allclose(sample.W, A.T @ A, rtol=0, atol=1e-14)
    a, e_N, _ = resolve(x._replace(W=sample.W), CONSTANT)
    np.testing.assert_allclose(a, A_inverse @ a_theta, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(e_N, A_inverse @ e_theta, rtol=1e-11, atol=1e-11)
    # It is another law than that of W = I.
    assert np.abs(a - resolve(x, IDENTITY)[0]).max() > 1e-6


@forms
@given(seeds, st.integers(1, 10), st.integers(1, 10))
def test_singular_values_of_stacks_of_any_shape(
    form: int, seed: int, m: int, rank: int
) -> None:
    """Also with more rows than joints, and of any rank."""
    x, rng = numbers(seed, 6, 7, form), np.random.default_rng(seed)
    J = rng.standard_normal((m, rank)) @ rng.standard_normal((rank, 7))
    resolution = Resolution([m], 7, form, x.K_N, 0.01)
    resolution.problem.task.jacobian[:] = J
    resolution.problem.metric.W[:] = x.W
    resolution.problem.metric.L[:] = np.linalg.cholesky(x.W)
    resolution.null_space_error[:] = x.g
    length, determinant, triangle = resolution.diagnose()
    expected = np.linalg.svd(J @ np.linalg.inv(np.linalg.cholesky(x.W)).T)[1]
    np.testing.assert_allclose(
        singular_values(triangle), expected, rtol=0, atol=1e-13 * expected[0]
    )
    # Each singular value has an error of a few roundings of the largest one.
    error = 1e-14 * expected[0]
    most, least = np.prod((expected + error) ** 2), np.prod((expected - error) ** 2)
    assert (least if expected[-1] > error else 0.0) <= determinant <= most
    np.testing.assert_allclose(length, np.sqrt(x.g @ x.W @ x.g), rtol=1e-13)
