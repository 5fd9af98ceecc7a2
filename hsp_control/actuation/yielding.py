"""How the law gives way: in which order, and how far the null space goes first."""

from typing import NamedTuple

import numpy as np

from hsp_control.actuation.programme import Rows
from hsp_control.arrays import Array
from hsp_control.linalg import solve_rows, solve_rows_transposed
from hsp_control.resolution import Resolution

_SINGLE, _SEVERAL = 1e-6, 1e-8
"""Cost of null-space motion beside the first level's. The smaller, the nearer to strict
order; 1e-6 leaves 1e-3 m/s² of the task (theory.md §6)."""


class Yielding(NamedTuple):
    """What a deviation δ from the law's acceleration costs, and its null-space part.

    Attributes:
        metric: H, shape (nv, nv).
        projector: P, shape (nv, nv): P δ is the part in the last null space.
    """

    metric: Array
    projector: Array


def yielding(
    resolution: Resolution, supported: bool, weight: float | None = None
) -> Yielding:
    """Return what deviations cost.

    Args:
        resolution: Whose levels yield.
        supported: Whether its first level is that of the contacts, whose rows are
            kept by constraints and not by cost.
        weight: Cost of null-space motion beside the first level's; None: the least.
    """
    J = resolution.problem.task.jacobian
    L = resolution.problem.metric.L
    n = J.shape[1]
    whitened = J.copy()
    solve_rows(L, whitened)
    levels = len(resolution.ends) - supported
    whole = weight or (_SINGLE if levels <= 1 else _SEVERAL)
    ratio = whole ** (1.0 / max(levels, 1))
    H = np.eye(n) * whole
    taken = np.zeros((n, 0))
    start = 0
    for level, end in enumerate(resolution.ends):
        block = whitened[start:end].T
        block = block - taken @ (taken.T @ block)
        U, s, _ = np.linalg.svd(block, full_matrices=False)
        N = U[:, s > resolution.threshold]
        cost = ratio ** max(level - supported, 0)
        H += (cost - whole) * (N @ N.T)
        taken = np.hstack([taken, N])
        start = end
    raised = taken.T.copy()
    solve_rows_transposed(L, raised)
    P = np.eye(n) - raised.T @ (taken.T @ L.T)
    return Yielding(np.asarray(L @ H @ L.T), P)


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
