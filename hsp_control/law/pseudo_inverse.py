"""The weighted pseudo-inverse, exact away from singularities and bounded through them.

    J# = W⁻¹Jᵀ q(JW⁻¹Jᵀ) = L⁻ᵀ B#,    B = J L⁻ᵀ,    W = L Lᵀ

In the whitened Jacobian B every metric is the Euclidean one, and B# = Qᵀ X is that of
`bounded_inverse`: it stays in these two factors, which the law multiplies by one after
the other. See ``docs/law.md``, Near singularities.
"""

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import (
    multiply,
    multiply_transposed,
    solve_lower,
    solve_lower_transposed,
)
from hsp_control.law.samples import IDENTITY


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
