"""How the law gives way: in which order, and how far the null space goes first."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import (
    orthogonalise_rows,
    orthonormalise_rows,
    solve_rows,
    solve_rows_transposed,
)
from hsp_control.control.actuation.qp import Rows
from hsp_control.law import Resolution
from hsp_control.law.pseudo_inverse import whiten
from hsp_control.null_space.metrics.metric import IDENTITY

_SINGLE, _SEVERAL = 1e-6, 1e-8
"""Cost of null-space motion beside the first level's. The smaller, the nearer to strict
order; 1e-6 leaves 1e-3 m/s² of the task (theory.md §6)."""


class DeviationCost(NamedTuple):
    """What a deviation δ from the law's acceleration costs, and its null-space part.

    Attributes:
        metric: H, shape (nv, nv).
        projector: P, shape (nv, nv): P δ is the part in the last null space.
    """

    metric: Array
    projector: Array


def deviation_cost(
    resolution: Resolution, supported: bool, weight: float | None = None
) -> DeviationCost:
    """Return what deviations cost.

    Args:
        resolution: Whose levels yield.
        supported: Whether its first level is that of the contacts, whose rows are
            kept by constraints and not by cost.
        weight: Cost of null-space motion beside the first level's; None: the least.
    """
    J = resolution.problem.task.jacobian
    L, form = resolution.problem.metric.L, resolution.form
    m, n = J.shape
    N, of_level = np.empty((n, n)), np.empty(n, dtype=np.int64)
    count = _directions(
        *(J, L, form, resolution.ends, resolution.threshold),
        *(np.empty((2, m, n)), np.empty((m, m)), N, of_level),
    )
    N, of_level = N[:count], of_level[:count]
    levels = len(resolution.ends) - supported
    whole = weight or (_SINGLE if levels <= 1 else _SEVERAL)
    ratio = whole ** (1.0 / max(levels, 1))
    costs = ratio ** np.maximum(of_level - supported, 0)
    one = np.eye(n)
    H = whole * one + (N.T * (costs - whole)) @ N
    if form == IDENTITY:
        return DeviationCost(H, one - N.T @ N)
    raised = N.copy()
    solve_rows_transposed(L, raised)
    return DeviationCost(np.asarray(L @ H @ L.T), one - raised.T @ (N @ L.T))


@kernel
def _directions(
    J: Array,
    L: Array,
    form: int,
    ends: Indices,
    threshold: float,
    wide: Array,
    X: Array,
    N: Array,
    of_level: Indices,
) -> int:
    """Write the directions of all levels, orthonormal rows in whitened coordinates.

    Args:
        J: Jacobian of all tasks, level after level, shape (m, nv).
        L: Cholesky factor of the metric, shape (nv, nv).
        form: The metric's form.
        ends: Where each level's rows end in the stack.
        threshold: Singular value below which a direction is nobody's.
        wide: Scratch, shape (2, m, nv).
        X: Scratch, shape (m, m).
        N: The directions, shape (nv, nv).
        of_level: Whose each is, shape (nv,).

    Returns:
        How many there are.
    """
    n = J.shape[1]
    count = start = 0
    whiten(J, L, form, wide[0])
    for level in range(ends.shape[0]):
        end = ends[level]
        B, Q, U = (
            wide[0, start:end],
            wide[1, start:end],
            X[: end - start, : end - start],
        )
        taken = count
        for k in range(end - start):
            for d in range(taken):
                share = 0.0
                for i in range(n):
                    share += N[d, i] * B[k, i]
                for i in range(n):
                    B[k, i] -= share * N[d, i]
        # Where no singular value is small any orthonormal rows do, and cost a tenth.
        regular = orthonormalise_rows(B, Q, U) >= threshold
        if not regular:
            orthogonalise_rows(B, U[:, :0])
        for k in range(end - start):
            square = 0.0
            for i in range(n):
                square += B[k, i] * B[k, i]
            size = np.sqrt(square)
            if count == n or not (regular or size > threshold):
                continue
            for i in range(n):
                N[count, i] = Q[k, i] if regular else B[k, i] / size
            of_level[count] = level
            count += 1
        start = end
    return count


def null_space_rows(
    resolution: Resolution, projector: Array, speed: Array, width: int
) -> Rows:
    """Return |(P δ)_j| ≤ λ s_j, on the first of x = (δ, f), which leaves e_N bounded.

    e_N' = -K_N e_N - P δ, up to what the law's correction takes care of, so that
    d/dt ‖e_N‖_W ≤ -λ ‖e_N‖_W + ‖P δ‖_W. δ = 0 is always within.

    Args:
        resolution: Whose null space it is.
        projector: P, shape (nv, nv).
        speed: s, shape (nv,) [rad/s or m/s].
        width: Length of x.
    """
    bounded = np.flatnonzero(np.isfinite(speed))
    A = np.zeros((len(bounded), width))
    A[:, : len(speed)] = projector[bounded]
    rate = decay_rate(resolution.problem.gain, resolution.problem.metric.L)
    most = rate * speed[bounded]
    return Rows(A, -most, most)


def decay_rate(gain: Array, L: Array) -> float:
    """Return λ, the least rate at which K_N lets ‖e_N‖_W decay [1/s], W = L Lᵀ."""
    first = float(gain[0, 0])
    if (gain == first * np.eye(len(gain))).all():
        return first
    lowered = L @ (L.T @ gain)
    both = 0.5 * (lowered + lowered.T)
    for _ in range(2):  # L⁻¹ from the left, then from the right
        both = both.T.copy()
        solve_rows(L, both)
    return float(np.linalg.eigvalsh(both)[0])
