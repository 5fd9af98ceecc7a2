"""Dense linear algebra for small matrices, as kernels: no allocation, no LAPACK.

Shapes: A and J are (m, n) unless a docstring says otherwise, L is lower triangular. The
bounded inverse of a wide B is B# = Qᵀ X: away from rank loss Q = X B has orthonormal
rows, X lower triangular; near it Q = U B has orthogonal rows, and X = q(s²) U inverts
the spectrum.
"""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel


@kernel
def copy(x: Array, out: Array) -> None:
    """Write x; shapes (n,)."""
    for i in range(out.shape[0]):
        out[i] = x[i]


@kernel
def multiply(A: Array, x: Array, out: Array) -> None:
    """Write A x; shapes (m, n), (n,) and (m,)."""
    for i in range(A.shape[0]):
        total = 0.0
        for j in range(A.shape[1]):
            total += A[i, j] * x[j]
        out[i] = total


@kernel
def multiply_transposed(A: Array, x: Array, out: Array) -> None:
    """Write Aᵀ x; shapes (m, n), (m,) and (n,)."""
    for j in range(A.shape[1]):
        out[j] = 0.0
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            out[j] += A[i, j] * x[i]


@kernel
def add_rows(weights: Array, rows: Array, out: Array) -> None:
    """Add Σ weight row to out, shape (n,), for as many rows as weights."""
    count, n = weights.shape[0], out.shape[0]
    for group in range(count // 4):
        r = 4 * group
        four, by = rows[r : r + 4], weights[r : r + 4]
        a, b, c, d = by[0], by[1], by[2], by[3]
        for j in range(n):
            out[j] += a * four[0, j] + b * four[1, j] + c * four[2, j] + d * four[3, j]
    for rest in range(count % 4):
        r = count - 1 - rest
        row, weight = rows[r], weights[r]
        for j in range(n):
            out[j] += weight * row[j]


@kernel
def norm(W: Array, x: Array) -> float:
    """Return ‖x‖_W = √(xᵀ W x); shapes (n, n) and (n,)."""
    square = 0.0
    for i in range(x.shape[0]):
        for j in range(x.shape[0]):
            square += x[i] * W[i, j] * x[j]
    return float(np.sqrt(square))


@kernel
def cholesky(A: Array, L: Array) -> bool:
    """Write the factor L of A = L Lᵀ (n, n); return whether A is positive definite."""
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
    """Overwrite x with L⁻¹ x; shapes (n, n) or larger, and (n,)."""
    for i in range(x.shape[0]):
        total = x[i]
        for k in range(i):
            total -= L[i, k] * x[k]
        x[i] = total / L[i, i]


@kernel
def solve_lower_transposed(L: Array, x: Array) -> None:
    """Overwrite x with L⁻ᵀ x; shapes (n, n) or larger, and (n,)."""
    n = x.shape[0]
    for j in range(n):  # along the rows of L, in the order of memory
        i = n - 1 - j
        x[i] /= L[i, i]
        found = x[i]
        for k in range(i):
            x[k] -= L[i, k] * found


@kernel
def solve_rows(L: Array, X: Array) -> None:
    """Overwrite X with X L⁻ᵀ: each row x with L⁻¹ x; shapes (n, n) and (m, n)."""
    for i in range(X.shape[0]):
        solve_lower(L, X[i])


@kernel
def solve_rows_transposed(L: Array, X: Array) -> None:
    """Overwrite X with X L⁻¹: each row x with L⁻ᵀ x; shapes (n, n) and (m, n)."""
    for i in range(X.shape[0]):
        solve_lower_transposed(L, X[i])


@kernel
def solve_columns(L: Array, X: Array) -> None:
    """Overwrite X with (L Lᵀ)⁻¹ X; shapes (m, m) and (m, n)."""
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
    """Write A Bᵀ, or A Bᵀ + B Aᵀ if ``symmetric``; A and B (m, n), ``out`` (m, m)."""
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
def orthonormalise_rows(J: Array, Q: Array, X: Array) -> float:
    """Write a lower triangular X (m, m), and Q = X J (m, n) with orthonormal rows.

    Modified Gram-Schmidt: each row is normalised, then its component is subtracted from
    the rows after it. X goes through the same steps. If a row loses nine tenths of its
    length or more, all rows are orthogonalised a second time ("twice is enough", Giraud
    et al. 2005), so that Q is orthonormal to rounding. A row that becomes zero leaves
    zeros in Q and X.

    Returns 1/‖X‖_F, a lower bound of J's smallest singular value, too small by a factor
    of √m at most; 0 if a row became zero, inf without rows.
    """
    m, n = J.shape
    for j in range(m):
        for i in range(n):
            Q[j, i] = J[j, i]
        for i in range(m):
            X[j, i] = 1.0 if i == j else 0.0
    cancelled = False
    for j in range(m):
        cancelled = _project_out_row(Q, X, j) < 0.01 * squared_norm(J[j]) or cancelled
    if cancelled:
        for j in range(m):
            _project_out_row(Q, X, j)
    total = 0.0
    for j in range(m):
        if X[j, j] == 0.0:
            return 0.0
        total += squared_norm(X[j, : j + 1])
    return float(1.0 / np.sqrt(total)) if total > 0.0 else np.inf


@kernel
def _project_out_row(Q: Array, X: Array, j: int) -> float:
    """Normalise row j, subtract its component from later rows; return its square."""
    m, n = Q.shape
    square = squared_norm(Q[j])
    scale = 1.0 / np.sqrt(square) if square > 0.0 else 0.0
    for i in range(n):
        Q[j, i] *= scale
    for i in range(j + 1):
        X[j, i] *= scale
    for k in range(j + 1, m):
        component = 0.0
        for i in range(n):
            component += Q[j, i] * Q[k, i]
        for i in range(n):
            Q[k, i] -= component * Q[j, i]
        for i in range(j + 1):
            X[k, i] -= component * X[j, i]
    return square


@kernel
def triangularise_rows(Y: Array) -> float:
    """Overwrite the lower triangle of Y (m, n), m ≤ n, with Y H's; return det(Y Yᵀ).

    H is orthogonal, a product of Householder's reflections: Y H is zero elsewhere, and
    has Y's singular values. The rest of Y is used.
    """
    m, n = Y.shape
    product = 1.0
    for j in range(m):
        first, square = Y[j, j], squared_norm(Y[j, j:])
        product *= square
        if square > 0.0:
            length = np.sqrt(square)
            diagonal = -length if first > 0.0 else length
            Y[j, j] = first - diagonal
            scale = 1.0 / (length * (length + abs(first)))
            for k in range(j + 1, m):
                component = 0.0
                for i in range(j, n):
                    component += Y[j, i] * Y[k, i]
                component *= scale
                for i in range(j, n):
                    Y[k, i] -= component * Y[j, i]
            Y[j, j] = diagonal
    return product


@kernel
def squared_norm(x: Array) -> float:
    """Return x·x, shape (n,)."""
    total = 0.0
    for i in range(x.shape[0]):
        total += x[i] * x[i]
    return total


@kernel
def smallest_singular_value_bound(X: Array) -> float:
    """Return 1/√‖X Xᵀ‖_F (m, m), a lower bound of the smallest singular value."""
    m = X.shape[0]
    square = 0.0
    for i in range(m):
        for j in range(i + 1):
            dot = 0.0
            for k in range(j + 1):
                dot += X[i, k] * X[j, k]
            square += dot * dot if i == j else 2.0 * dot * dot
    return float(1.0 / np.sqrt(np.sqrt(square)))


@kernel
def orthogonalise_rows(Y: Array, U: Array) -> None:
    """Overwrite Y (m, n) with U Y, whose rows are orthogonal; U (m, m) is orthogonal.

    One-sided Jacobi, in rounds of pairs that share no row, on several of which a
    processor works at a time. The norms of the new rows are the singular values of Y;
    small ones have high relative accuracy (Demmel and Veselić 1992). Y may be
    rank-deficient. A U of shape (0, m) is not written.
    """
    m = Y.shape[0]
    for i in range(m):
        for j in range(U.shape[0]):
            U[i, j] = 1.0 if i == j else 0.0
    turning = m - 1 + m % 2  # with an even m the last row is in one pair of each round
    for _ in range(30):  # sweeps; about six are needed
        rotated = False
        for r in range(turning):
            if turning < m:
                rotated = _rotate_rows(Y, U, r, turning) or rotated
            for k in range(1, (turning + 1) // 2):
                p = r - k if r >= k else r - k + turning
                q = r + k if r + k < turning else r + k - turning
                rotated = _rotate_rows(Y, U, min(p, q), max(p, q)) or rotated
        if not rotated:
            return


@kernel
def _rotate_rows(Y: Array, U: Array, p: int, q: int) -> bool:
    """Rotate two rows so that they are orthogonal; return whether they were not."""
    n = Y.shape[1]
    alpha = beta = gamma = 0.0
    for i in range(n):
        alpha += Y[p, i] * Y[p, i]
        beta += Y[q, i] * Y[q, i]
        gamma += Y[p, i] * Y[q, i]
    if abs(gamma) <= 1e-15 * np.sqrt(alpha * beta) or gamma * gamma == 0.0:
        return False
    # The tangent of the smaller angle, where a quotient of the two might overflow.
    apart, twice = beta - alpha, 2.0 * gamma
    t = twice / (abs(apart) + np.sqrt(apart * apart + twice * twice))
    if apart < 0.0:
        t = -t
    c = 1.0 / np.sqrt(1.0 + t * t)
    s = c * t
    for i in range(n):
        y = Y[p, i]
        Y[p, i] = c * y - s * Y[q, i]
        Y[q, i] = s * y + c * Y[q, i]
    for i in range(U.shape[0]):
        y = U[p, i]
        U[p, i] = c * y - s * U[q, i]
        U[q, i] = s * y + c * U[q, i]
    return True


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
