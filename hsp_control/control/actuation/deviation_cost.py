"""Cost of deviations from the law's acceleration; bound on their null-space part."""

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

_ONE_LEVEL, _SEVERAL_LEVELS = 1e-6, 1e-8
"""Cost of null-space deviation relative to the first level: two values, for one level
and for several. The smaller it is, the stricter the priorities; at 1e-6 an error of
1e-3 m/s² remains in the task (docs/limits.md)."""


class DeviationCost(NamedTuple):
    """The cost ½ δᵀH δ of a deviation δ from the law's acceleration.

    Attributes:
        metric: H, shape (nv, nv).
        projector: P, shape (nv, nv): P δ is the part of δ in the null space of all
            tasks.
    """

    metric: Array
    projector: Array


def deviation_cost(
    resolution: Resolution, supported: bool, weight: float | None = None
) -> DeviationCost:
    """Return the cost of deviations from the law's acceleration.

    Args:
        resolution: The resolved law, with its levels and its metric.
        supported: Whether the first level is that of the contacts, whose rows are kept
            by constraints and not by cost.
        weight: Cost of null-space deviation relative to the first level; None: the
            default, `_ONE_LEVEL` or `_SEVERAL_LEVELS`.
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
    whole = weight or (_ONE_LEVEL if levels <= 1 else _SEVERAL_LEVELS)
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
        threshold: Singular value below which a direction belongs to no level.
        wide: Scratch, shape (2, m, nv).
        X: Scratch, shape (m, m).
        N: Written: the directions, shape (nv, nv).
        of_level: Written: the level of each direction, shape (nv,).

    Returns:
        The number of directions.
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
        # If no singular value is small, any orthonormal rows will do, at a tenth of the
        # cost.
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
    """Return the rows |(P δ)_j| ≤ λ s_j on x = (δ, f), which keep e_N bounded.

    e_N' = -K_N e_N - P δ, up to terms that the law's correction cancels, so that
    d/dt ‖e_N‖_W ≤ -λ ‖e_N‖_W + ‖P δ‖_W. δ = 0 always satisfies the rows.

    Args:
        resolution: The resolved law, with its gain and its metric.
        projector: P, shape (nv, nv).
        speed: s, shape (nv,) [rad/s or m/s].
        width: Length of x.
    """
    bounded = np.flatnonzero(np.isfinite(speed))
    A = np.zeros((len(bounded), width))
    A[:, : len(speed)] = projector[bounded]
    rate = decay_rate(resolution.problem.gain, resolution.problem.metric.L)
    limit = rate * speed[bounded]
    return Rows(A, -limit, limit)


def decay_rate(gain: Array, L: Array) -> float:
    """Return λ, the slowest rate at which ‖e_N‖_W decays [1/s], W = L Lᵀ.

    Args:
        gain: K_N, shape (nv, nv) [1/s].
        L: Cholesky factor of the metric, shape (nv, nv).
    """
    first = float(gain[0, 0])
    if (gain == first * np.eye(len(gain))).all():
        return first
    lowered = L @ (L.T @ gain)
    both = 0.5 * (lowered + lowered.T)
    for _ in range(2):  # L⁻¹ from the left, then from the right
        both = both.T.copy()
        solve_rows(L, both)
    return float(np.linalg.eigvalsh(both)[0])
