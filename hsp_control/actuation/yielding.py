"""In which order the law gives way: the metric of what limits cost."""

import numpy as np
from scipy.linalg import solve_triangular

from hsp_control.arrays import Array
from hsp_control.resolution import Resolution

_SINGLE, _SEVERAL = 1e-6, 1e-8
"""Cost of null-space motion beside the first level's. The smaller, the nearer to strict
order; 1e-6 leaves 1e-3 m/s² of the task (theory.md §6)."""


def yielding_metric(resolution: Resolution, supported: bool) -> Array:
    """Return H, shape (nv, nv): what a deviation from the law's acceleration costs.

    Args:
        resolution: Whose levels yield.
        supported: Whether its first level is that of the contacts, whose rows are
            kept by constraints and not by cost.
    """
    J = resolution.problem.task.jacobian
    L = resolution.problem.metric.L
    n = J.shape[1]
    whitened = solve_triangular(L, J.T, lower=True)
    levels = len(resolution.ends) - supported
    whole = _SINGLE if levels <= 1 else _SEVERAL
    ratio = whole ** (1.0 / max(levels, 1))
    H = np.eye(n) * whole
    taken = np.zeros((n, 0))
    start = 0
    for level, end in enumerate(resolution.ends):
        block = whitened[:, start:end]
        block = block - taken @ (taken.T @ block)
        U, s, _ = np.linalg.svd(block, full_matrices=False)
        N = U[:, s > resolution.threshold]
        cost = ratio ** max(level - supported, 0)
        H += (cost - whole) * (N @ N.T)
        taken = np.hstack([taken, N])
        start = end
    return np.asarray(L @ H @ L.T)
