"""Linear algebra against NumPy, rank loss included."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from oracles import close

from hsp_control import engine
from hsp_control.common.arrays import Array

EPS = float(np.finfo(float).eps)

seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 9)
exponents = st.floats(-12.0, 0.0)
scales = st.floats(-6.0, 6.0).map(lambda k: 10.0**k)


def normal(seed: int, *shape: int) -> Array:
    return np.random.default_rng(seed).standard_normal(shape)


def orthogonal(seed: int, n: int, m: int) -> Array:
    """Return n × m orthonormal columns."""
    return np.linalg.qr(normal(seed, n, n))[0][:, :m]


def spectrum(seed: int, n: int, m: int, singular_values: Array) -> Array:
    """Return an n × m matrix with given singular values, shape (m,)."""
    left, right = orthogonal(seed, n, m), orthogonal(seed + 1, m, m)
    return (left * singular_values) @ right.T


def junk(*shape: int) -> Array:
    """Return an output that must be written in full."""
    return np.full(shape, np.nan)


def cholesky(A: Array, L: Array) -> bool:
    return bool(engine.Cholesky(A=np.ascontiguousarray(A), L=L)())


def solve_lower(L: Array, x: Array) -> None:
    engine.SolveLower(L=L, x=x)()


def solve_lower_transposed(L: Array, x: Array) -> None:
    engine.SolveLowerTransposed(L=L, x=x)()


def orthonormalise_rows(J: Array, Q: Array, X: Array) -> float:
    return engine.OrthonormaliseRows(J=np.ascontiguousarray(J), Q=Q, X=X)()


def orthogonalise_rows(Y: Array, U: Array) -> None:
    engine.OrthogonaliseRows(Y=Y, U=U)()


def triangularise_rows(Y: Array) -> float:
    return engine.TriangulariseRows(Y=Y)()


def smallest_singular_value_bound(X: Array) -> float:
    return engine.SmallestSingularValueBound(X=X)()


# --- triangles -----------------------------------------------------------------------


@given(seeds, sizes, exponents, scales)
def test_cholesky(seed: int, n: int, exponent: float, scale: float) -> None:
    """L is lower triangular, of positive diagonal, and L Lᵀ = A to rounding."""
    values = np.logspace(0.0, exponent, n)
    U = orthogonal(seed, n, n)
    A = scale * (U * values) @ U.T
    A = 0.5 * (A + A.T)
    L = junk(n, n)
    assert cholesky(A, L)
    assert (np.diag(L) > 0.0).all()
    np.testing.assert_array_equal(np.triu(L, 1), 0.0)
    close(L @ L.T, A, 4 * n * EPS * scale)
    # The relative error of the factor grows with A's condition number.
    close(L, np.linalg.cholesky(A), 10 * n * EPS * np.sqrt(scale) * 10.0**-exponent)


@pytest.mark.parametrize(
    "A",
    [
        np.zeros((1, 1)),
        -np.eye(2),
        np.ones((2, 2)),  # singular, exactly
        np.diag([1.0, 0.0, 1.0]),
        np.diag([1.0, np.nan]),
        np.array([[1.0, np.nan], [np.nan, 1.0]]),
    ],
)
def test_cholesky_refuses(A: Array) -> None:
    assert not cholesky(A, junk(*A.shape))


@given(seeds, sizes, exponents)
def test_triangular_solves(seed: int, n: int, exponent: float) -> None:
    """Backward stable: |L x - b| ≤ n ε |L||x|, however ill-conditioned L is."""
    L = np.tril(normal(seed, n, n))
    L[np.diag_indices(n)] = np.logspace(0.0, exponent, n)
    b = normal(seed + 1, n)
    x, y = b.copy(), b.copy()
    solve_lower(L, x)
    solve_lower_transposed(L, y)
    bound = 2 * n * EPS
    assert (np.abs(L @ x - b) <= bound * np.abs(L) @ np.abs(x)).all()
    assert (np.abs(L.T @ y - b) <= bound * np.abs(L).T @ np.abs(y)).all()


# --- orthogonalisation ---------------------------------------------------------------


@given(seeds, sizes, sizes, exponents, scales)
def test_orthonormalise(
    seed: int, n: int, m: int, exponent: float, scale: float
) -> None:
    """Q = X J to rounding, and Q is orthonormal to rounding at every condition."""
    assume(m <= n)
    J = scale * spectrum(seed, n, m, np.logspace(0.0, exponent, m)).T
    Q, X = junk(m, n), junk(m, m)
    bound = orthonormalise_rows(J, Q, X)
    close(Q @ Q.T, np.eye(m), 10 * n * EPS)
    # Rounding relative to the summands, amplified by cancellation: the condition.
    slack = 20 * n * EPS * np.abs(X) @ np.abs(J) * 10.0**-exponent
    assert (np.abs(X @ J - Q) <= slack + 1e-15).all()
    np.testing.assert_array_equal(np.triu(X, 1), 0.0)
    assert (np.diag(X) > 0.0).all()
    # X is the inverse of the triangular factor, which is Householder's but for signs.
    T = np.linalg.qr(J.T)[1].T
    T *= np.sign(np.diag(T))
    close(T @ X, np.eye(m), 100 * n * EPS * 10.0**-exponent)
    # A bound of the least singular value, within √m.
    least = scale * (10.0**exponent if m > 1 else 1.0)
    allowed = 1.0 + 100 * n * EPS * 10.0**-exponent
    assert bound <= least * allowed
    assert bound * np.sqrt(m) * allowed >= least


def test_no_rows_are_orthonormal() -> None:
    assert orthonormalise_rows(np.zeros((0, 7)), junk(0, 7), junk(0, 0)) == np.inf


@given(seeds, sizes, st.data(), scales)
def test_triangularise_rows(
    seed: int, n: int, data: st.DataObject, scale: float
) -> None:
    """T Tᵀ = Y Yᵀ at any rank: T is Y in other coordinates."""
    m = data.draw(st.integers(1, n))
    rank = data.draw(st.integers(0, m))
    Y = scale * normal(seed, m, rank) @ normal(seed + 1, rank, n)
    T = Y.copy()
    determinant = triangularise_rows(T)
    T = np.tril(T[:, :m])
    size = np.abs(Y).max(initial=0.0) ** 2
    close(T @ T.T, Y @ Y.T, 20 * n * m * EPS * size)
    np.testing.assert_allclose(determinant, np.prod(np.diag(T) ** 2), rtol=1e-13)


@given(seeds, sizes, st.data(), scales)
def test_orthogonalise_rows(
    seed: int, n: int, data: st.DataObject, scale: float
) -> None:
    """U Y has orthogonal rows whose norms are the singular values; any rank."""
    m = data.draw(st.integers(1, n))
    rank = data.draw(st.integers(0, m))
    exponent = data.draw(exponents)
    values = np.zeros(m)
    values[:rank] = scale * np.logspace(0.0, exponent, rank)
    Y = spectrum(seed, n, m, values).T.copy()
    turned, U = Y.copy(), junk(m, m)
    orthogonalise_rows(turned, U)
    close(U @ U.T, np.eye(m), 20 * m * EPS)
    close(turned, U @ Y, 20 * m * EPS * scale)
    norms = np.linalg.norm(turned, axis=1)
    close(np.sort(norms)[::-1], np.linalg.svd(Y)[1], 20 * n * EPS * scale)
    # Orthogonal in the sense of cosines, not only of small products.
    gram = turned @ turned.T
    cosines = np.abs(gram) / np.maximum(np.outer(norms, norms), 1e-300)
    kept = norms > 1e-13 * max(norms.max(), 1e-300)
    off = cosines[np.ix_(kept, kept)] - np.eye(int(kept.sum()))
    assert np.abs(off).max(initial=0.0) < 1e-12


@given(st.lists(st.integers(-999, 999), min_size=8, max_size=8), st.integers(20, 60))
def test_small_singular_values_to_high_relative_accuracy(
    entries: list[int], shift: int
) -> None:
    """Rows of very different size: σ_min to 1e-13 of itself (LAPACK: of σ_max).

    Exactly: σ_max σ_min = √det(YᵀY), in rational numbers.
    """
    Y = np.array(entries, dtype=float).reshape(4, 2)
    Y[:, 1] *= 2.0**-shift  # exact
    exact = [[Fraction(value) for value in row] for row in Y.tolist()]
    a = sum(row[0] ** 2 for row in exact)
    b = sum(row[0] * row[1] for row in exact)
    c = sum(row[1] ** 2 for row in exact)
    determinant = a * c - b * b
    # Columns at an angle of less than 0.01 are ill-conditioned beyond their scaling.
    assume(determinant > a * c / 10_000)
    turned, U = Y.T.copy(), junk(2, 2)
    orthogonalise_rows(turned, U)
    small, large = np.sort(np.linalg.norm(turned, axis=1))
    product = float(determinant) ** 0.5
    np.testing.assert_allclose(small * large, product, rtol=1e-11)
    np.testing.assert_allclose(large, np.linalg.norm(Y, 2), rtol=1e-13)


@given(st.integers(0, 2**32 - 1), st.integers(1, 12))
def test_bounds_of_the_least_singular_value(seed: int, m: int) -> None:
    """Both lie below it, the second within m to the power of a quarter."""
    rng = np.random.default_rng(seed)
    J = rng.standard_normal((m, m + 2))
    Q, X = np.zeros((m, m + 2)), np.zeros((m, m))
    loose = orthonormalise_rows(J, Q, X)
    tight = smallest_singular_value_bound(X)
    true = np.linalg.svd(J, compute_uv=False)[-1]
    assert loose <= true * (1.0 + 1e-9)
    assert tight <= true * (1.0 + 1e-9)
    assert tight >= true * m**-0.25 * (1.0 - 1e-9)
