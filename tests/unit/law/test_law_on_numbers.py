"""Check the law on random numbers against its short form in plain NumPy."""

import numpy as np
import oracles
import pytest
from hypothesis import given
from hypothesis import strategies as st
from law_numbers import Numbers, numbers, resolve

from hsp_control.common.arrays import Array
from hsp_control.law import CONSTANT, IDENTITY, VARYING, Resolution, singular_values

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
