"""A cost of distance that is exactly zero far away and grows without bound nearby."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel

CORE = 0.02
"""Fraction of the influence below which the barrier goes on as a parabola, finite in
contact and beyond."""


@kernel
def barrier_at(s: float) -> tuple[float, float, float]:
    """Return b(s), b' and b'': b = -(1 - s)² ln s, s the distance over the influence.

    Twice continuously differentiable: zero for s ≥ 1, infinite towards s = 0 but for
    its core (Li et al. 2020, incremental potential contact).
    """
    if s >= 1.0:
        return 0.0, 0.0, 0.0
    at = max(s, CORE)
    away, log = 1.0 - at, np.log(at)
    value = -away * away * log
    slope = 2.0 * away * log - away * away / at
    bend = -2.0 * log + 4.0 * away / at + away * away / (at * at)
    if s < CORE:
        value += (slope + 0.5 * bend * (s - at)) * (s - at)
        slope += bend * (s - at)
    return value, slope, bend


@kernel
def barrier(distances: Array, influence: float, slopes: Array, bends: Array) -> float:
    """Return Σ b(d_k/influence), write its slopes and bends by d_k."""
    total = 0.0
    for k in range(distances.shape[0]):
        value, slope, bend = barrier_at(distances[k] / influence)
        total += value
        slopes[k] = slope / influence
        bends[k] = bend / (influence * influence)
    return total
