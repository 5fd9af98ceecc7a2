"""From an impedance to the gains that give it at a state.

With J_e the Jacobian of the error's coordinates, e' = -J_e v plus what the reference
does, G = Λ⁻¹ = J_e M⁻¹ J_eᵀ and an external force f, τ = J_eᵀ f:

    e'' = e''_commanded - G f

so that e''_commanded = -Kv e' - Kp e with

    Kp = G S,    Kv = -½ G' Λ + G D + 2 ζ √(G K)

gives Λ e'' + (½ Λ' + D + D_ζ) e' + S e = -f, because Λ' = -Λ G' Λ. S = K up to the
spring's largest force (`slipping`). D_ζ = 2 ζ Λ √(G K) is symmetric,
and damps each mode of (Λ, K) with the ratio ζ. With K = C Cᵀ,

    √(G K) = C⁻ᵀ √(Cᵀ G C) Cᵀ,

which needs no inverse of G. Only the first term does. There Λ = J̄ᵀ M J̄, with the
pseudo-inverse J̄ = M⁻¹J_eᵀΛ, bounded where the law bounds its own.
"""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import (
    bounded_inverse,
    cholesky,
    gram,
    orthogonalise_rows,
    solve_rows,
    solve_rows_transposed,
    squared_norm,
)
from hsp_control.compiled.rotations import compose, jexp3_dot, jlog3
from hsp_control.law import TaskSample
from hsp_control.tasks.feedback import Feedback
from hsp_control.tasks.slipping import bounded_stiffness

_THRESHOLD = 0.03  # default threshold of the law's singularities: see `Controller`


class Rotating(NamedTuple):
    """Which rows of an error are a rotation vector, and what rotates."""

    first: int  # the first of the three rows; the number of rows if there are none
    rotation: Array  # world ← frame, (3, 3)
    angular_velocity: Array  # of the frame, in world axes, (3,) [rad/s]


class ImpedanceScratch(NamedTuple):
    """Memory of `impedance_gains`."""

    factor: Array  # (nv, nv)
    wide: Array  # (5, m, nv)
    square: Array  # (10, m, m)
    turning: Array  # (4, 3, 3)
    vectors: Array  # (2, 3)
    rows: Array  # (3, m)

    @classmethod
    def allocate(cls, rows: int, nv: int) -> "ImpedanceScratch":
        """Return zeros."""
        return cls(
            np.zeros((nv, nv)),
            np.zeros((5, rows, nv)),
            np.zeros((10, rows, rows)),
            np.zeros((4, 3, 3)),
            np.zeros((2, 3)),
            np.zeros((3, rows)),
        )


@kernel
def impedance_gains(
    M: Array,
    M_dot: Array,
    rotating: Rotating,
    numbers: Array,
    ends: Indices,
    sample: TaskSample,
    scratch: ImpedanceScratch,
    mobility: Array,
    feedback: Feedback,
) -> None:
    """Write Λ⁻¹, Kp and Kv: what the task's own kernel then reads.

    Where M is singular they are NaN, so that the law reports that the step is not
    finite.

    Shapes: M (nv, nv), M_dot (nv, nv), ends (parts,), mobility (m, m).
    """
    m, nv = sample.jacobian.shape
    K, D, ratio = numbers[:m], numbers[m : 2 * m], numbers[2 * m, 0]
    Kp, Kv = feedback.Kp, feedback.Kv
    L, B, B_dot, X = scratch.factor, scratch.wide[0], scratch.wide[1], scratch.wide[2]
    G, G_dot, GK, root = (
        mobility,
        scratch.square[0],
        scratch.square[1],
        scratch.square[2],
    )
    error_jacobian(rotating, sample, scratch.turning, scratch.vectors, B, B_dot)
    total = 1.0
    for i in range(nv):
        total += M[i, i]
    if not cholesky(M, L):
        Kp[0, 0] = Kv[0, 0] = np.nan
        return
    solve_rows(L, B)  # J_e L⁻ᵀ
    gram(B, B, False, G)
    # G' = A M⁻¹J_eᵀ + its transpose, A = J_e' - ½ J_e M⁻¹M'.
    for i in range(m):
        for j in range(nv):
            X[i, j] = B[i, j]
    solve_rows_transposed(L, X)  # J_e M⁻¹
    for i in range(m):
        for j in range(nv):
            for k in range(nv):
                B_dot[i, j] -= 0.5 * X[i, k] * M_dot[k, j]
    gram(B_dot, X, True, G_dot)
    gram(G, K, False, GK)  # K, D and Λ are symmetric
    gram(G, D, False, Kv)
    if ratio > 0.0:
        natural_root(B, K, scratch.wide[3], scratch.square, root)
        for i in range(m):
            for j in range(m):
                Kv[i, j] += 2.0 * ratio * root[i, j]
    inertia = scratch.square[3]
    Q = scratch.wide[4]
    # The law whitens with its own metric: W = I at worst, where the singular values of
    # J L⁻ᵀ may be less than those of J by √(largest eigenvalue of M).
    bounded_inertia(B, _THRESHOLD / np.sqrt(total), Q, scratch.square[4], inertia)
    gram(G_dot, inertia, False, root)
    S = scratch.square[6]
    if bounded_stiffness(
        numbers, ends, sample.error, scratch.square[7:], scratch.rows, S
    ):
        gram(G, S, False, GK)
    for i in range(m):
        for j in range(m):
            Kv[i, j] -= 0.5 * root[i, j]
            Kp[i, j] = GK[i, j]


@kernel
def error_jacobian(
    rotating: Rotating,
    sample: TaskSample,
    turning: Array,
    vectors: Array,
    J_e: Array,
    J_e_dot: Array,
) -> None:
    """Write J_e and J_e': J and J', but T J and its rate for a rotation vector.

    e = -y with y' = T ω, T = Jlog(y) Rᵀ, plus what the reference does; hence
    T' = -Jlog Jexp' T - T [ω]×.

    Shapes: turning (4, 3, 3), vectors (2, 3), J_e (m, nv), J_e_dot (m, nv).
    """
    J, J_dot, e, e_dot, _ = sample
    m, nv = J.shape
    for i in range(m):
        for j in range(nv):
            J_e[i, j] = J[i, j]
            J_e_dot[i, j] = J_dot[i, j]
    first, R, w = rotating
    if first + 3 > m:
        return
    T, T_dot, part, other = turning[0], turning[1], turning[2], turning[3]
    y, y_dot = vectors[0], vectors[1]
    for i in range(3):
        y[i], y_dot[i] = -e[first + i], -e_dot[first + i]
    jlog3(y, part)
    for i in range(3):
        for j in range(3):
            T[i, j] = 0.0
            for k in range(3):
                T[i, j] += part[i, k] * R[j, k]
    jexp3_dot(y, y_dot, other)
    compose(part, other, T_dot)
    compose(T_dot, T, part)
    for i in range(3):
        # T [ω]×, row by row: (T [ω]×)_i = T_i × ω.
        a, b, c = T[i, 0], T[i, 1], T[i, 2]
        T_dot[i, 0] = -part[i, 0] - (b * w[2] - c * w[1])
        T_dot[i, 1] = -part[i, 1] - (c * w[0] - a * w[2])
        T_dot[i, 2] = -part[i, 2] - (a * w[1] - b * w[0])
    for i in range(3):
        for j in range(nv):
            J_e[first + i, j] = J_e_dot[first + i, j] = 0.0
            for k in range(3):
                J_e[first + i, j] += T[i, k] * J[first + k, j]
                J_e_dot[first + i, j] += (
                    T[i, k] * J_dot[first + k, j] + T_dot[i, k] * J[first + k, j]
                )


@kernel
def natural_root(B: Array, K: Array, Z: Array, square: Array, out: Array) -> None:
    """Write √(G K) = C⁻ᵀ √(Cᵀ G C) Cᵀ, with G = B Bᵀ and K = C Cᵀ.

    The singular values of Cᵀ B are the natural frequencies of the modes [rad/s].

    Shapes: B (m, nv), K (m, m), Z (m, nv), square (6, m, m), out (m, m).
    """
    m, nv = B.shape
    C, U, S = square[3], square[4], square[5]
    cholesky(K, C)
    for i in range(m):
        for j in range(nv):
            Z[i, j] = 0.0
            for k in range(i, m):
                Z[i, j] += C[k, i] * B[k, j]
    orthogonalise_rows(Z, U)  # Cᵀ G C = Uᵀ diag(ω²) U
    for i in range(m):
        for j in range(m):
            S[i, j] = 0.0
    for k in range(m):
        frequency = np.sqrt(squared_norm(Z[k]))
        for i in range(m):
            for j in range(m):
                S[i, j] += U[k, i] * frequency * U[k, j]
    solve_rows_transposed(C, S)  # S C⁻¹, the transpose of C⁻ᵀ S
    for i in range(m):
        for j in range(m):
            out[i, j] = 0.0
            for k in range(j + 1):
                out[i, j] += S[k, i] * C[j, k]


@kernel
def bounded_inertia(B: Array, threshold: float, Q: Array, X: Array, out: Array) -> None:
    """Write Λ = (B#)ᵀ B#, the inverse of B Bᵀ; it fades to zero where B loses rank.

    Shapes: B (m, nv), Q (m, nv), X (m, m), out (m, m).
    """
    bounded_inverse(B, threshold, Q, X)
    m = B.shape[0]
    for i in range(m):
        for j in range(m):
            out[i, j] = 0.0
    for k in range(m):  # the rows of Q are orthogonal
        square = squared_norm(Q[k])
        for i in range(m):
            for j in range(m):
                out[i, j] += square * X[k, i] * X[k, j]
