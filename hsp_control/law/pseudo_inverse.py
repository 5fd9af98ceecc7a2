"""The weighted pseudo-inverse, exact away from singularities and bounded through them.

Written for the whitened Jacobian B = J L⁻ᵀ with W = L Lᵀ, in which every metric is the
Euclidean one. It is kept as the two factors of `bounded_inverse`, which the law
multiplies by one after the other: J# = L⁻ᵀ Qᵀ X.
"""

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import (
    bounded_inverse,
    multiply,
    multiply_transposed,
    solve_lower,
    solve_lower_transposed,
)
from hsp_control.law.samples import IDENTITY


@kernel
def weighted_pseudo_inverse(
    J: Array,
    L: Array,
    form: int,
    threshold: float,
    B: Array,
    Q: Array,
    X: Array,
) -> bool:
    """Write the factors of J# = W⁻¹Jᵀ q(JW⁻¹Jᵀ), and return whether it was damped.

    q(x) = 1/x for x ≥ threshold² and (2 - x/threshold²)/threshold² below it
    (docs/law.md, Near singularities): continuously differentiable, exactly the inverse
    while every singular value of J L⁻ᵀ is above the threshold, and bounded: ‖J# in
    whitened coordinates‖ ≤ 1.09/threshold. Rank loss is a special case.

    Args:
        J: Task Jacobian, shape (m, nv), m ≤ nv.
        L: Cholesky factor of the metric, shape (nv, nv).
        form: The metric's form.
        threshold: Singular value below which damping starts.
        B: Scratch, shape (m, nv); holds the whitened Jacobian afterwards.
        Q: Rows that span those of B, shape (m, nv).
        X: Shape (m, m).
    """
    whiten(J, L, form, B)
    return bounded_inverse(B, threshold, Q, X)


@kernel
def whiten(J: Array, L: Array, form: int, B: Array) -> None:
    """Write B = J L⁻ᵀ."""
    for k in range(J.shape[0]):
        for i in range(J.shape[1]):
            B[k, i] = J[k, i]
        if form != IDENTITY:
            solve_lower(L, B[k])


@kernel
def apply_pseudo_inverse(
    Q: Array, X: Array, L: Array, form: int, x: Array, part: Array, out: Array
) -> None:
    """Write J# x = L⁻ᵀ Qᵀ X x, the smallest motion that gives x; part is scratch."""
    multiply(X, x, part)
    multiply_transposed(Q, part, out)
    if form != IDENTITY:
        solve_lower_transposed(L, out)


@kernel
def apply_pseudo_inverse_transpose(
    Q: Array, X: Array, L: Array, form: int, y: Array, part: Array, out: Array
) -> None:
    """Write J#ᵀ y = Xᵀ Q L⁻¹ y, and overwrite y by L⁻¹ y; part is scratch."""
    if form != IDENTITY:
        solve_lower(L, y)
    multiply(Q, y, part)
    multiply_transposed(X, part, out)
