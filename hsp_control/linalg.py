"""Small dense linear algebra as kernels: no allocation, no LAPACK call."""

import numpy as np

from hsp_control.arrays import Array
from hsp_control.kernels import kernel


@kernel
def multiply(A: Array, x: Array, out: Array) -> None:
    """Write A x."""
    for i in range(A.shape[0]):
        total = 0.0
        for j in range(A.shape[1]):
            total += A[i, j] * x[j]
        out[i] = total


@kernel
def multiply_transposed(A: Array, x: Array, out: Array) -> None:
    """Write Aᵀ x."""
    for j in range(A.shape[1]):
        out[j] = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            out[j] += A[i, j] * x[i]


@kernel
def cholesky(A: Array, L: Array) -> bool:
    """Write the lower triangle L of A = L Lᵀ; return whether A is positive definite."""
    n = A.shape[0]
    for j in range(n):
        pivot = A[j, j]
        for k in range(j):
            pivot -= L[j, k] * L[j, k]
        if not pivot > 0.0:
            return False
        L[j, j] = np.sqrt(pivot)
        for i in range(j + 1, n):
            total = A[i, j]
            for k in range(j):
                total -= L[i, k] * L[j, k]
            L[i, j] = total / L[j, j]
            L[j, i] = 0.0
    return True


@kernel
def solve_lower(L: Array, x: Array) -> None:
    """Overwrite x by L⁻¹ x."""
    for i in range(L.shape[0]):
        total = x[i]
        for k in range(i):
            total -= L[i, k] * x[k]
        x[i] = total / L[i, i]


@kernel
def solve_lower_transposed(L: Array, x: Array) -> None:
    """Overwrite x by L⁻ᵀ x."""
    n = L.shape[0]
    for j in range(n):
        i = n - 1 - j
        total = x[i]
        for k in range(i + 1, n):
            total -= L[k, i] * x[k]
        x[i] = total / L[i, i]


@kernel
def solve_columns(L: Array, X: Array) -> None:
    """Overwrite X by (L Lᵀ)⁻¹ X, row by row, in the order that they lie in memory."""
    m, n = X.shape
    for i in range(m):
        for k in range(i):
            for j in range(n):
                X[i, j] -= L[i, k] * X[k, j]
        for j in range(n):
            X[i, j] /= L[i, i]
    for r in range(m):
        i = m - 1 - r
        for k in range(i + 1, m):
            for j in range(n):
                X[i, j] -= L[k, i] * X[k, j]
        for j in range(n):
            X[i, j] /= L[i, i]


@kernel
def gram(A: Array, B: Array, symmetric: bool, out: Array) -> None:
    """Write A Bᵀ, or A Bᵀ + B Aᵀ."""
    m, n = A.shape
    for i in range(m):
        for k in range(m):
            total = 0.0
            for j in range(n):
                total += A[i, j] * B[k, j]
            out[i, k] = total
    if symmetric:
        for i in range(m):
            out[i, i] *= 2.0
            for k in range(i):
                out[i, k] += out[k, i]
                out[k, i] = out[i, k]


@kernel
def orthonormalise(B: Array, Q: Array, R: Array) -> None:
    """Write the thin factors B = Q R of an n × m matrix with n ≥ m.

    Gram-Schmidt, each column cleaned twice ("twice is enough", Giraud et al. 2005), so
    that Q is orthonormal to rounding. A column that vanishes leaves zeros in Q and a
    zero on the diagonal of R.
    """
    n, m = B.shape
    for j in range(m):
        for i in range(n):
            Q[i, j] = B[i, j]
        for k in range(m):
            R[k, j] = 0.0
        for _ in range(2):
            for k in range(j):
                dot = 0.0
                for i in range(n):
                    dot += Q[i, k] * Q[i, j]
                R[k, j] += dot
                for i in range(n):
                    Q[i, j] -= dot * Q[i, k]
        square = 0.0
        for i in range(n):
            square += Q[i, j] * Q[i, j]
        R[j, j] = np.sqrt(square)
        scale = 1.0 / R[j, j] if R[j, j] > 0.0 else 0.0
        for i in range(n):
            Q[i, j] *= scale


@kernel
def invert_upper(R: Array, out: Array) -> float:
    """Write R⁻¹ and return a lower bound of R's least singular value, 1/‖R⁻¹‖_F.

    The bound is within √m of the singular value, and 0 for a singular R (whose
    inverse is then not written to the end).
    """
    m = R.shape[0]
    square = 0.0
    for j in range(m):
        if R[j, j] == 0.0:
            return 0.0
        out[j, j] = 1.0 / R[j, j]
        square += out[j, j] * out[j, j]
        for i in range(j + 1, m):
            out[i, j] = 0.0
        for k in range(j):
            i = j - 1 - k
            total = 0.0
            for p in range(i + 1, j + 1):
                total += R[i, p] * out[p, j]
            out[i, j] = -total / R[i, i]
            square += out[i, j] * out[i, j]
    return float(1.0 / np.sqrt(square))


@kernel
def least_singular_value_bound(V: Array) -> float:
    """Return 1/√‖V Vᵀ‖_F for an upper triangular V = R⁻¹: a bound of R's least one.

    It is within the fourth root of m of the least singular value of R, tighter than
    that of `invert_upper`.
    """
    m = V.shape[0]
    square = 0.0
    for i in range(m):
        for j in range(i + 1):
            dot = 0.0
            for k in range(i, m):
                dot += V[i, k] * V[j, k]
            square += dot * dot if i == j else 2.0 * dot * dot
    return float(1.0 / np.sqrt(np.sqrt(square)))


@kernel
def orthogonalise_columns(Y: Array, V: Array) -> None:
    """Overwrite Y by Y V with orthogonal columns, V orthogonal (one-sided Jacobi).

    The columns' norms are then Y's singular values, small ones to high relative
    accuracy (Demmel and Veselić 1992). Rank loss is welcome.
    """
    n, m = Y.shape
    for i in range(m):
        for j in range(m):
            V[i, j] = 1.0 if i == j else 0.0
    for _ in range(30):  # sweeps; about six are needed
        rotated = False
        for p in range(m - 1):
            for q in range(p + 1, m):
                alpha = beta = gamma = 0.0
                for i in range(n):
                    alpha += Y[i, p] * Y[i, p]
                    beta += Y[i, q] * Y[i, q]
                    gamma += Y[i, p] * Y[i, q]
                if abs(gamma) <= 1e-15 * np.sqrt(alpha * beta) or gamma == 0.0:
                    continue
                rotated = True
                zeta = (beta - alpha) / (2.0 * gamma)
                sign = 1.0 if zeta >= 0.0 else -1.0
                t = sign / (abs(zeta) + np.hypot(1.0, zeta))
                c = 1.0 / np.hypot(1.0, t)
                s = c * t
                for i in range(n):
                    y = Y[i, p]
                    Y[i, p] = c * y - s * Y[i, q]
                    Y[i, q] = s * y + c * Y[i, q]
                for i in range(m):
                    y = V[i, p]
                    V[i, p] = c * y - s * V[i, q]
                    V[i, q] = s * y + c * V[i, q]
        if not rotated:
            return
