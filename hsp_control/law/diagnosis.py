"""How near the law is to a singular posture and to rest."""

from math import isqrt

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import (
    norm,
    orthogonalise_rows,
    squared_norm,
    triangularise_rows,
)
from hsp_control.law.pseudo_inverse import whiten


def singular_values(triangle: bytes) -> Array:
    """Return the singular values of J L⁻ᵀ, the largest first, shape (min(m, nv),).

    Args:
        triangle: What the call of `Resolution.diagnosis` wrote, as bytes.
    """
    T = np.frombuffer(triangle).copy()
    values = np.zeros(isqrt(len(T)))
    _singular_values(T.reshape(len(values), len(values)), values)
    return values


@kernel
def diagnose(
    J: Array,
    W: Array,
    L: Array,
    form: int,
    e_N: Array,
    scratch: Array,
    T: Array,
    length: Array,
) -> float:
    """Write T, triangular with the singular values of J L⁻ᵀ, and ‖e_N‖_W.

    Returns:
        The product of their squares.
    """
    length[0] = norm(W, e_N)
    m, n = J.shape
    B = scratch[0, :m, :n]
    whiten(J, L, form, B)
    if m > n:
        transposed = scratch[1, :n, :m]
        for i in range(n):
            for k in range(m):
                transposed[i, k] = B[k, i]
        B = transposed
    product = triangularise_rows(B)
    for i in range(T.shape[0]):
        for k in range(i + 1):
            T[i, k] = B[i, k]
    return float(product)


@kernel
def _singular_values(T: Array, values: Array) -> None:
    """Write the singular values of a triangle, the largest first; T is overwritten.

    Its columns are nearer to orthogonal than the rows of what it is a factor of.
    """
    orthogonalise_rows(T, T[:0])
    m = values.shape[0]
    for k in range(m):
        values[k] = np.sqrt(squared_norm(T[k]))
    for rank in range(m):
        best = rank
        for k in range(rank + 1, m):
            if values[k] > values[best]:
                best = k
        values[rank], values[best] = values[best], values[rank]
