"""Check the pseudo-inverse: its axioms, its bound, and its smoothness."""

import numpy as np
import oracles
from hypothesis import assume, example, given
from hypothesis import strategies as st
from law_cases import pseudo_inverse
from law_numbers import jacobian, positive
from numpy.typing import NDArray

Array = NDArray[np.float64]
seeds = st.integers(0, 2**32 - 1)

BOUND = np.sqrt(32.0 / 27.0)  # max of s q(s²) threshold, at s = threshold √(2/3)


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
