"""The weighted pseudo-inverse, exact away from singularities and bounded through them.

Written for the whitened Jacobian B = L⁻¹Jᵀ with W = L Lᵀ, in which every metric is
the Euclidean one: J# = L⁻ᵀ B q(BᵀB), where q inverts the spectrum.
"""

from hsp_control.arrays import Array
from hsp_control.kernels import kernel
from hsp_control.linalg import (
    invert_upper,
    least_singular_value_bound,
    orthogonalise_columns,
    orthonormalise,
    solve_lower,
    solve_lower_transposed,
)
from hsp_control.metrics.metric import IDENTITY


@kernel
def weighted_pseudo_inverse(
    J: Array,
    L: Array,
    form: int,
    threshold: float,
    B: Array,
    Q: Array,
    R: Array,
    V: Array,
    out: Array,
) -> bool:
    """Write J# = W⁻¹Jᵀ q(JW⁻¹Jᵀ); return whether a singular value was damped.

    q(x) = 1/x for x ≥ threshold² and (2 - x/threshold²)/threshold² below it (law.md
    §4): continuously differentiable, exactly the inverse while every singular value of
    J L⁻ᵀ is above the threshold, and bounded: ‖J# in whitened coordinates‖ ≤
    1.09/threshold. Rank loss is a special case.

    Args:
        J: Task Jacobian, shape (m, nv), m ≤ nv.
        L: Cholesky factor of the metric, shape (nv, nv).
        form: The metric's form.
        threshold: Singular value below which damping starts.
        B: Scratch, shape (nv, m); holds the whitened Jacobian's transpose afterwards.
        Q: Scratch, shape (nv, m).
        R: Scratch, shape (m, m).
        V: Scratch, shape (m, m).
        out: J#, shape (nv, m).
    """
    m, n = J.shape
    for k in range(m):
        for i in range(n):
            B[i, k] = J[k, i]
        if form != IDENTITY:
            solve_lower(L, B[:, k])
    orthonormalise(B, Q, R)
    damped = False
    # The spectrum is asked for only where cheaper bounds leave open whether it is met.
    bound = invert_upper(R, V)
    if 0.0 < bound < threshold:
        bound = least_singular_value_bound(V)
    if bound < threshold:
        damped = _robust_factor(B, threshold, Q, R, V)
    # Away from singularities J# = L⁻ᵀ Q R⁻ᵀ, near them J# = L⁻ᵀ (B U) q(S²) Uᵀ: in both
    # cases the product of what Q and V hold now.
    for i in range(n):
        for k in range(m):
            total = 0.0
            for p in range(m):
                total += Q[i, p] * V[k, p]
            out[i, k] = total
    if form != IDENTITY:
        for k in range(m):
            solve_lower_transposed(L, out[:, k])
    return damped


@kernel
def _robust_factor(B: Array, threshold: float, Q: Array, U: Array, V: Array) -> bool:
    """Write Q = B U, with columns of norms s, and V = U q(s²); any s damped?"""
    n, m = B.shape
    for i in range(n):
        for k in range(m):
            Q[i, k] = B[i, k]
    orthogonalise_columns(Q, U)
    floor = threshold * threshold
    damped = False
    for k in range(m):
        x = 0.0
        for i in range(n):
            x += Q[i, k] * Q[i, k]
        inverse = 1.0 / x if x >= floor else (2.0 - x / floor) / floor
        damped = damped or x < floor
        for i in range(m):
            V[i, k] = U[i, k] * inverse
    return damped
