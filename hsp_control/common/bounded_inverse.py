"""The pseudo-inverse of a wide matrix in two factors, bounded where its rank is lost.

B# = Qᵀ X for B of shape (m, n), m ≤ n. Away from rank loss Q = X B has orthonormal
rows, X lower triangular; near it Q = U B has orthogonal rows, and X = q(s²) U inverts
the spectrum.
"""

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import (
    orthogonalise_rows,
    orthonormalise_rows,
    smallest_singular_value_bound,
)


@kernel
def bounded_inverse(B: Array, threshold: float, Q: Array, X: Array) -> bool:
    """Write the factors of B# = Bᵀ q(B Bᵀ), and return whether it was damped.

    q(x) = 1/x for x ≥ threshold² and (2 - x/threshold²)/threshold² below it: exactly
    the pseudo-inverse while every singular value of B is above the threshold,
    continuously differentiable, and bounded: ‖B#‖ ≤ 1.09/threshold. B has the shape
    (m, n), m ≤ n; the rows of Q (m, n) span those of B; X has the shape (m, m).
    """
    # The spectrum is computed only where cheaper bounds cannot decide.
    bound = orthonormalise_rows(B, Q, X)
    if 0.0 < bound < threshold:
        bound = smallest_singular_value_bound(X)
    if bound < threshold:
        return _bounded_factors(B, threshold, Q, X)
    return False


@kernel
def _bounded_factors(B: Array, threshold: float, Q: Array, X: Array) -> bool:
    """Write Q = U B with rows of norms s, and X = q(s²) U; return whether it damped."""
    m, n = B.shape
    for k in range(m):
        for i in range(n):
            Q[k, i] = B[k, i]
    orthogonalise_rows(Q, X)
    floor = threshold * threshold
    damped = False
    for k in range(m):
        x = 0.0
        for i in range(n):
            x += Q[k, i] * Q[k, i]
        inverse = 1.0 / x if x >= floor else (2.0 - x / floor) / floor
        damped = damped or x < floor
        for i in range(m):
            X[k, i] *= inverse
    return damped
