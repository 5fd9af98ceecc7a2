"""The edge: the law is exact where tasks can be met, and damped where they cannot.

    a = a_exact + μ (a_damped - a_exact),      0 ≤ μ ≤ 1

Out of reach an error persists, and with it what the feedback asks for. Near a singular
posture the exact inverse of that changes faster than a sampled loop bears, so the
inverse of a_damped is bounded by thresholds that follow what is asked for
(`threshold.py`). But a threshold cannot tell an error that persists from a step within
reach. What can is where the arm is held, and how: singular, or far away, or at a limit.
So μ is the largest of three shares, each of them 0 in the middle:

    near    σ ≥ σ_x: 0;  σ ≤ σ_x/2: 1.    σ_x is a tenth of the robot's size
    far     |e| ≤ 0.85 ℓ: 0;  |e| ≥ ℓ: 1.      ℓ is the largest error that is fed back
    limits  a_exact is within all limits: 0;  a tenth beyond one: 1

with σ the smallest singular value of the stack J, whatever the metric. The first two
are here, the last is where limits are known, in `limited_target.py`.
All are continuous, so a is.

``docs/edge.md`` has what follows from it.
"""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import copy, orthogonalise_rows, squared_norm

NEAR = 0.1
"""σ_x over the robot's size: the law is exact in every posture that is farther from a
singular one, whatever a step asks for."""

FAR = 0.85
"""Part of ℓ up to which errors are far from being those of a hand that is held."""


@kernel
def smooth_share(x: float) -> float:
    """Return 0 for x ≤ 0 and 1 for x ≥ 1, and between them 3x² - 2x³."""
    x = min(max(x, 0.0), 1.0)
    return x * x * (3.0 - 2.0 * x)


@kernel
def near_share(J: Array, size: float, least: float, turned: Array) -> float:
    """Return how near a singular posture is, from 0 to 1.

    Args:
        J: The stack, shape (m, nv).
        size: The robot's size [m].
        least: ε_0: no exact law is asked for below twice of it.
        turned: Scratch, shape (m, nv).
    """
    smallest = np.inf
    for k in range(J.shape[0]):
        copy(J[k], turned[k])
    orthogonalise_rows(turned, turned[:0, :0])
    for k in range(J.shape[0]):
        smallest = min(smallest, squared_norm(turned[k]))
    edge = max(NEAR * size, 2.0 * least)
    return float(smooth_share(2.0 - 2.0 * np.sqrt(smallest) / edge))


@kernel
def far_share(stretched: Array) -> float:
    """Return how far an error is, from 0 to 1; ``stretched`` is |e|/ℓ of each row."""
    most = 0.0
    for k in range(stretched.shape[0]):
        most = max(most, stretched[k])
    return float(smooth_share((most - FAR) / (1.0 - FAR)))
