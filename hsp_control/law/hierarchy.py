"""Strict priorities: the law for levels of tasks that may conflict.

    Q_0 = W⁻¹,   G_k = J_k Q_{k-1} J_kᵀ                                  `open_level`
    a ← a + Q_{k-1} J_kᵀ q(G_k) (a_k - J_k'v - J_k a)                     `add_level`
    Q_k = Q_{k-1} - Q_{k-1} J_kᵀ q(G_k) J_k Q_{k-1}                     `close_level`

Each level acts in the null space of the levels above. Those stay exact, whatever the
lower level requires. The field is the last level: with P = Q_K W, J_a the stack of all
levels, and w any solution of J_aᵀ w = W(I - P)x, found by going back through them,

    φ_N = Q_K [ W(g' + K_N e_N) - J_a'ᵀ w + W'(x - e_N/2) ],   e_N = P x,  x = g - v

so that V' = -e_NᵀW K_N e_N as long as the stack keeps its rank, conflicts included:
`add_null_space`. How far each inverse q(G_k) is bounded is the edge's,
`edge/damped_levels.py`, which goes through the levels.

If the stack has full rank, this equals the law of `law.py` up to rounding. That law is
then used, because it takes a tenth of the time. The smallest singular value of the
stack is a lower bound for those of all levels (Schur complements interlace), so both
give the same result where one replaces the other. ``docs/law.md``, Priorities.
"""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import (
    multiply,
    multiply_transposed,
    orthogonalise_rows,
    solve_lower,
    solve_lower_transposed,
    squared_norm,
)
from hsp_control.law.samples import VARYING, FieldSample, MetricSample, TaskSample


class LevelScratch(NamedTuple):
    """Memory of the levels between the steps."""

    Q: Array  # (nv, nv); the last null space's Q_K = P W⁻¹ afterwards
    QJ: Array  # Q_{k-1} J_kᵀ of all levels side by side, shape (nv, m)
    G_inverse: Array  # q(G_k) of all levels along the diagonal, shape (m, m)
    square: Array  # (2, m, m)
    rows: Array  # (6, max(nv, m))


@kernel
def invert_metric(L: Array, out: Array) -> None:
    """Write W⁻¹ = (L Lᵀ)⁻¹."""
    n = L.shape[0]
    for j in range(n):
        for i in range(n):
            out[j, i] = 1.0 if i == j else 0.0
        solve_lower(L, out[j])
        solve_lower_transposed(L, out[j])


@kernel
def open_level(J: Array, Q: Array, QJ: Array, G: Array, V: Array, x: Array) -> float:
    """Write Q Jᵀ and J Q Jᵀ = Σ x_r V_r V_rᵀ; return the smallest x."""
    m, n = J.shape
    for k in range(m):
        multiply(Q, J[k], QJ[:, k])
    for p in range(m):
        for k in range(p + 1):
            total = 0.0
            for i in range(n):
                total += J[p, i] * QJ[i, k]
            G[p, k] = G[k, p] = total
    # G is symmetric and not negative: its rows' lengths become its eigenvalues.
    orthogonalise_rows(G[:m, :m], V)
    smallest = np.inf
    for k in range(m):
        x[k] = np.sqrt(squared_norm(G[k, :m]))
        smallest = min(smallest, x[k])
    return smallest


@kernel
def write_bounded_inverse(
    V: Array, x: Array, threshold: float, q: Array, out: Array
) -> None:
    """Write q(G) of G = Σ x_r V_r V_rᵀ, see `pseudo_inverse.py`; q is overwritten."""
    m, floor = out.shape[0], threshold * threshold
    for r in range(m):
        q[r] = 1.0 / x[r] if x[r] >= floor else (2.0 - x[r] / floor) / floor
    for p in range(m):
        for k in range(m):
            total = 0.0
            for r in range(m):
                total += V[r, p] * q[r] * V[r, k]
            out[p, k] = total


@kernel
def add_level(QJ: Array, G_inverse: Array, rest: Array, row: Array, a: Array) -> None:
    """Add Q Jᵀ q(G) times what is left to do to a."""
    n, m = QJ.shape
    multiply(G_inverse, rest[:m], row[:m])
    for i in range(n):
        for k in range(m):
            a[i] += QJ[i, k] * row[k]


@kernel
def close_level(Q: Array, QJ: Array, G_inverse: Array, row: Array) -> None:
    """Overwrite Q by Q - QJᵀ q(G) JQ, which stays symmetric."""
    n, m = QJ.shape
    for i in range(n):
        multiply_transposed(G_inverse, QJ[i], row[:m])
        for j in range(i + 1):
            total = 0.0
            for k in range(m):
                total += row[k] * QJ[j, k]
            Q[i, j] -= total
            if j < i:
                Q[j, i] = Q[i, j]


@kernel
def add_null_space(
    task: TaskSample,
    field: FieldSample,
    metric: MetricSample,
    form: int,
    v: Array,
    K_N: Array,
    controls: bool,
    ends: Indices,
    scratch: LevelScratch,
    e_N: Array,
    a: Array,
) -> None:
    """Write e_N, and add φ_N to a; all levels are closed.

    Args:
        task: All tasks, level after level: J and J', shape (m, nv) each.
        field: g and g', shape (nv,) each.
        metric: W and W', shape (nv, nv) each.
        form: The metric's form.
        v: Velocity, shape (nv,).
        K_N: Null-space gain [1/s], shape (nv, nv).
        controls: False for φ_N = 0.
        ends: Where each level's rows end in the stack.
        scratch: What the levels left, and memory.
        e_N: Null-space error, shape (nv,).
        a: Acceleration, shape (nv,).
    """
    J, J_dot, g, g_dot = task.jacobian, task.jacobian_dot, field.g, field.g_dot
    W, W_dot, Q, QJ = metric.W, metric.W_dot, scratch.Q, scratch.QJ
    G_inverse, square, rows = scratch.G_inverse, scratch.square, scratch.rows
    n = v.shape[0]

    # x = g - v, and what the levels take of it and of its motion
    x, Wx, Y, bent = rows[0, :n], rows[1, :n], rows[2, :n], rows[3, :n]
    for i in range(n):
        x[i] = g[i] - v[i]
        Y[i] = bent[i] = 0.0
    multiply(W, x, Wx)
    for reverse in range(ends.shape[0]):
        level = ends.shape[0] - 1 - reverse
        end = ends[level]
        start = ends[level - 1] if level > 0 else 0
        row, w = square[0, 0, : end - start], square[0, 1, : end - start]
        for k in range(end - start):
            row[k] = 0.0
            for i in range(n):
                row[k] += QJ[i, start + k] * (Wx[i] - Y[i])
        multiply(G_inverse[start:end, start:end], row, w)
        for k in range(end - start):
            for i in range(n):
                Y[i] += J[start + k, i] * w[k]
                bent[i] += J_dot[start + k, i] * w[k]

    # e_N = Q W x, and φ_N of Equation (13) over the metric
    multiply(Q, Wx, e_N)
    if not controls:
        return
    rate = rows[4, :n]
    multiply(K_N, e_N, rate)
    for i in range(n):
        rate[i] += g_dot[i]
    multiply(W, rate, Y)
    for i in range(n):
        Y[i] -= bent[i]
    if form == VARYING:
        for i in range(n):
            for j in range(n):
                Y[i] += W_dot[i, j] * (x[j] - 0.5 * e_N[j])
    multiply(Q, Y, rate)
    for i in range(n):
        a[i] += rate[i]
