"""Where a limit binds, the law that a step comes near to is the damped one.

The law promises nothing where a limit binds. An arm that is held at its edge, or rushes
to it, asks for more than its motors give, from one side and then from the other: the
nearest step within the limits would swing with it. So as far as the law's acceleration
is beyond a limit, the step comes near to the damped law instead (`law/edge.py`):

    a ← a + λ (a_damped - a),      λ = min(x/0.1, 1)

with x the largest excess relative to what the limit permits: of an effort, the maximum;
of an acceleration, what the barriers of `Limits` permit far from them. The limit on the
effort's rate does not count: it depends on the last effort, and a step that waits for
it would wait for ever. λ is a continuous function of the state, and so is a.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import squared_norm
from hsp_control.constraints.limits.acceleration_bounds import Bounds, MotionLimits

WHOLE = 0.1
"""Excess from which on nothing is left of the exact law."""


class Permitted(NamedTuple):
    """What limits permit far from them, shape (nv,) each; inf where there is none."""

    effort: Array  # [N·m or N]
    acceleration: Array  # [rad/s² or m/s²]

    @classmethod
    def by(cls, effort: Array, motion: MotionLimits) -> Self:
        """Return it for maximum efforts and the limits of the motion."""
        bandwidth = motion.bandwidth[0]
        with np.errstate(invalid="ignore"):
            half = 0.5 * (motion.upper - motion.lower)
        acceleration = np.minimum(bandwidth * motion.velocity, bandwidth**2 * half)
        return cls(np.array(effort), np.minimum(acceleration, motion.acceleration))


@kernel
def add_damped_share(
    M: Array,
    a: Array,
    effort: Array,
    a_law: Array,
    a_damped: Array,
    bounds: Bounds,
    permitted: Permitted,
    A: Array,
    lower: Array,
    change: Array,
) -> None:
    """Add λ (a_damped - a_law) to a, and what it takes to the effort M a + N.

    Args:
        M: Mass matrix, shape (nv, nv).
        a: What the step is to come near to, shape (nv,).
        effort: M a + N, shape (nv,).
        a_law: The law's acceleration, shape (nv,).
        a_damped: That of the damped law, shape (nv,).
        bounds: Bounds on the acceleration.
        permitted: What excesses are relative to.
        A: Rows of barriers, A δ ≥ lower for a deviation δ, shape (k, at least nv).
        lower: Shape (k,); it is changed to be for deviations from the new a.
        change: Scratch, shape (nv,).
    """
    n, most, least = a.shape[0], 0.0, np.inf
    for i in range(n):
        most = max(most, abs(effort[i]) / permitted.effort[i] - 1.0)
        beyond = max(a[i] - bounds.a_upper[i], bounds.a_lower[i] - a[i])
        most = max(most, beyond / permitted.acceleration[i])
        least = min(least, permitted.acceleration[i])
    for r in range(lower.shape[0]):
        if lower[r] > 0.0:
            most = max(most, lower[r] / (np.sqrt(squared_norm(A[r, :n])) * least))
    share = min(most / WHOLE, 1.0)
    if share == 0.0:
        return
    for i in range(n):
        change[i] = share * (a_damped[i] - a_law[i])
    for i in range(n):
        a[i] += change[i]
        for j in range(n):
            effort[i] += M[i, j] * change[j]
    for r in range(lower.shape[0]):
        for i in range(n):
            lower[r] -= A[r, i] * change[i]
