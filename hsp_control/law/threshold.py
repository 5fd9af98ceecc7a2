"""Where an inverse begins to be bounded: a threshold that follows the errors.

A level asks for J a = d. Along a direction of the singular value s it gets d/s where s
is above the threshold ε, and s (2 - s²/ε²) d/ε² below. The steepest of both is 2 d/ε²,
at s = 0. Let f = Kv e' + Kp s(e) be what the feedback asks for, the part of d that
persists while a task cannot be met. With

    ε² = max(ε_0², (‖f‖ - f_0)/L)

the acceleration that it causes changes by at most 2 (L + f_0/ε_0²) for each unit of s,
whatever the target. A task that is tracked has f = 0 nearly, at any speed: for it the
law is exact down to ε_0. ``docs/law.md``, The edge, has the proposition.
"""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel

STIFFNESS, MODEST = 200.0, 1.0
"""L times the robot's size [1/s²]. A stretched elbow is then drawn to its singular
posture by a spring of at most 2 L |∂s/∂q| ≤ 400 1/s² of its own inertia, 20 rad/s: slow
beside periods of up to 10 ms, and damped by a null-space gain of 10 1/s. And f_0 over
the robot's size [1/s²]: what a position 1 % of the size away asks for at 10 rad/s."""


@kernel
def write_thresholds(
    asked: Array, ends: Indices, least: float, steepest: float, thresholds: Array
) -> float:
    """Write ε of each level, and return the largest.

    Args:
        asked: f, what the feedback of the tasks asks for, level after level, (m,).
        ends: Where each level's rows end in the stack, shape (levels,).
        least: ε_0.
        steepest: L [rad/s² for each unit of a singular value].
        thresholds: ε of each level, shape (levels,).
    """
    largest, start = least, 0
    for level in range(ends.shape[0]):
        square = 0.0
        for k in range(start, ends[level]):
            square += asked[k] * asked[k]
        beyond = max(np.sqrt(square) - MODEST * STIFFNESS / steepest, 0.0)
        thresholds[level] = max(least, np.sqrt(beyond / steepest))
        largest = max(largest, thresholds[level])
        start = ends[level]
    return float(largest)
