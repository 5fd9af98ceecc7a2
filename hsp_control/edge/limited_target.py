"""What a step comes near to where a limit binds.

The law promises nothing where a limit binds. Then it is taken apart,

    a = a_t + φ_N,

into what the tasks make of it and the self-motion (`self_motion.py`). Two things
change, as far as a is beyond a limit, so that the step is a continuous function of the
state:

*The tasks are damped.* An arm that is held at its edge, or rushes to it, asks for more
than its motors give, from one side and then from the other: the nearest step within the
limits would swing with it. So as far as a_t alone is beyond the limits, the step comes
near to the damped law instead (`shares.py`).

*What a field asks for is bounded.* That is φ_N + P K_N P v, the self-motion without
what brakes it. A field may ask for anything; at most what the limits permit far from
them is asked of the QP, and what brakes stays whole: else it would swing at the limits.

An excess is relative to what the limit permits: of an effort, the maximum; of an
acceleration, what the barriers of `Limits` permit far from them. It counts wholly from
a tenth on. The limit on the effort's rate does not count: it depends on the last
effort, and a step that waits for it would wait for ever.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import multiply, squared_norm

LARGE = 0.1
"""Excess from which on it counts wholly."""


class Permitted(NamedTuple):
    """What limits permit far from them, shape (nv,) each; inf where there is none."""

    effort: Array  # [N·m or N]
    acceleration: Array  # [rad/s² or m/s²]

    @classmethod
    def by(
        cls, effort: Array, span: Array, speed: Array, most: Array, bandwidth: float
    ) -> Self:
        """Return it.

        Args:
            effort: Maximum efforts, shape (nv,) as all of these.
            span: Upper minus lower position limits.
            speed: Maximum speeds.
            most: Maximum accelerations.
            bandwidth: α of the barriers that keep positions and speeds [1/s].
        """
        acceleration = np.minimum(bandwidth * speed, bandwidth**2 * (0.5 * span))
        return cls(np.array(effort), np.minimum(acceleration, most))


class Parts(NamedTuple):
    """The law's acceleration and the damped law's, and what they are made of."""

    law: Array  # shape (nv,) each
    damped: Array
    law_self_motion: Array  # φ_N
    damped_self_motion: Array
    law_braking: Array  # P K_N P v
    damped_braking: Array


class Within(NamedTuple):
    """Bounds on the acceleration, shape (nv,) each."""

    lower: Array
    upper: Array


class Barred(NamedTuple):
    """Rows of barriers: A δ ≥ lower for a deviation δ from what is wanted."""

    A: Array  # shape (k, at least nv)
    lower: Array  # shape (k,)


@kernel
def write_limited_target(
    M: Array,
    a: Array,
    effort: Array,
    parts: Parts,
    bounds: Within,
    permitted: Permitted,
    barred: Barred,
    scratch: Array,
) -> None:
    """Overwrite what is wanted by what the step is to come near to.

    Args:
        M: Mass matrix, shape (nv, nv).
        a: The law's acceleration, and what compensators add, shape (nv,).
        effort: M a + N, and what compensators add, shape (nv,).
        parts: The law's acceleration, and what it is made of.
        bounds: Bounds on the acceleration.
        permitted: What excesses are relative to.
        barred: Rows of barriers; ``lower`` then is for deviations from the new a.
        scratch: Shape (4, nv).
    """
    n = a.shape[0]
    a_t, tau_t, change, part = scratch[0], scratch[1], scratch[2], scratch[3]
    whole = _excess(a, effort, bounds, permitted, barred, change, 0.0)
    multiply(M, parts.law_self_motion, part)
    for i in range(n):
        a_t[i] = a[i] - parts.law_self_motion[i]
        tau_t[i] = effort[i] - part[i]
        change[i] = -parts.law_self_motion[i]
    tasks = min(_excess(a_t, tau_t, bounds, permitted, barred, change, 1.0), whole)
    for i in range(n):
        change[i] = tasks * (parts.damped[i] - parts.law[i])
    asked, asked_damped = scratch[0], scratch[1]
    for i in range(n):
        asked[i] = parts.law_self_motion[i] + parts.law_braking[i]
        asked_damped[i] = parts.damped_self_motion[i] + parts.damped_braking[i]
    ours = 1.0 - _permitted_part(M, asked, permitted, part)
    theirs = 1.0 - _permitted_part(M, asked_damped, permitted, part)
    for i in range(n):
        change[i] -= whole * (1.0 - tasks) * ours * asked[i]
        change[i] -= whole * tasks * theirs * asked_damped[i]
    multiply(M, change, part)
    for i in range(n):
        a[i] += change[i]
        effort[i] += part[i]
    for r in range(barred.lower.shape[0]):
        for i in range(n):
            barred.lower[r] -= barred.A[r, i] * change[i]


@kernel
def _excess(
    a: Array,
    effort: Array,
    bounds: Within,
    permitted: Permitted,
    barred: Barred,
    change: Array,
    changed: float,
) -> float:
    """Return by how much an acceleration is beyond limits, from 0 to 1."""
    # ``changed`` is 1 if a differs by ``change`` from what ``barred`` is for.
    most, least = 0.0, np.inf
    for i in range(a.shape[0]):
        most = max(most, abs(effort[i]) / permitted.effort[i] - 1.0)
        beyond = max(a[i] - bounds.upper[i], bounds.lower[i] - a[i])
        most = max(most, beyond / permitted.acceleration[i])
        least = min(least, permitted.acceleration[i])
    for r in range(barred.lower.shape[0]):
        row = barred.A[r, : a.shape[0]]
        missing = barred.lower[r]
        for i in range(a.shape[0]):
            missing -= changed * row[i] * change[i]
        if missing > 0.0:
            most = max(most, missing / (np.sqrt(squared_norm(row)) * least))
    return float(min(most / LARGE, 1.0))


@kernel
def _permitted_part(M: Array, asked: Array, permitted: Permitted, tau: Array) -> float:
    """Return which part of an acceleration the limits permit far from them."""
    multiply(M, asked, tau)
    most = 1.0
    for i in range(tau.shape[0]):
        most = max(most, abs(tau[i]) / permitted.effort[i])
        most = max(most, abs(asked[i]) / permitted.acceleration[i])
    return 1.0 / most
