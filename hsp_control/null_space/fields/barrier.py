"""A barrier function of distance: exactly zero when far, growing when near."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel

CORE = 0.02
"""Value of s below which the barrier continues as a parabola, finite for all s."""


@kernel
def barrier_at(s: float) -> tuple[float, float, float]:
    """Return b(s), b' and b'': b = -(1 - s)² ln s, s the distance over the influence.

    C², zero for s ≥ 1. For s < CORE its second-order Taylor polynomial at CORE replaces
    it, so that it stays finite (Li et al. 2020, incremental potential contact).
    """
    if s >= 1.0:
        return 0.0, 0.0, 0.0
    at = max(s, CORE)
    away, log = 1.0 - at, np.log(at)
    value = -away * away * log
    slope = 2.0 * away * log - away * away / at
    curvature = -2.0 * log + 4.0 * away / at + away * away / (at * at)
    if s < CORE:
        value += (slope + 0.5 * curvature * (s - at)) * (s - at)
        slope += curvature * (s - at)
    return value, slope, curvature


@kernel
def barrier(
    distances: Array, influence: float, slopes: Array, curvatures: Array
) -> float:
    """Return Σ b(d_k/influence), write its slopes and curvatures by d_k."""
    total = 0.0
    for k in range(distances.shape[0]):
        value, slope, curvature = barrier_at(distances[k] / influence)
        total += value
        slopes[k] = slope / influence
        curvatures[k] = curvature / (influence * influence)
    return total
