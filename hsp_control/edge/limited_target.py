"""The acceleration that a step approximates while a limit is active.

While a limit is active the law's equations cannot hold. Then it is decomposed,

    a = a_t + φ_N,

into the tasks' part and the self-motion (`self_motion.py`). Two things change, in
proportion to the excess of a beyond a limit, so that the step is a continuous function
of the state:

*The tasks are damped.* An arm at its workspace boundary, or moving fast towards it,
commands more than its motors supply, with alternating signs: the nearest step within
the limits would oscillate. So in proportion to the excess of a_t alone, the step
approaches the damped law instead (`shares.py`), and reaches it at E_t = 2.

*The field's command is bounded.* That is φ_N + P K_N P v, the self-motion without its
damping. A field's command is unbounded; at most the value that the limits permit far
from them is passed to the QP; damping is not scaled, or the null space would oscillate
at the limits.

An excess E is relative to the permitted value: for an effort, its maximum; for an
acceleration, that of the barriers of `Limits` far from them. A field keeps at least
1/(1 + E): a command that is reduced by more than its excess oscillates there. The limit
on the effort's rate is ignored: it depends on the last effort, and a step that waited
for it would wait for ever.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.engine.plans import PartCall

LARGE = 2.0
"""Excess of the tasks above which the damped law applies fully: commands of three times
the permitted value."""


class Permitted(NamedTuple):
    """The bounds far from all limits, shapes (nv,); inf without one."""

    effort: Array  # [N·m or N]
    acceleration: Array  # [rad/s² or m/s²]

    @classmethod
    def by(
        cls, effort: Array, span: Array, speed: Array, most: Array, bandwidth: float
    ) -> Self:
        """Return the bounds far from all limits of a robot.

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
    """The law's acceleration and the damped law's, and their components."""

    law: Array  # shapes (nv,)
    damped: Array
    law_self_motion: Array  # φ_N
    damped_self_motion: Array
    law_braking: Array  # P K_N P v
    damped_braking: Array


class Within(NamedTuple):
    """Bounds on the acceleration, shapes (nv,)."""

    lower: Array
    upper: Array


class Barred(NamedTuple):
    """Rows of barriers: A δ ≥ lower for a deviation δ from the unconstrained a."""

    A: Array  # shape (k, at least nv)
    lower: Array  # shape (k,)


def limited_target(
    M: Array,
    a: Array,
    effort: Array,
    parts: Parts,
    bounds: Within,
    permitted: Permitted,
    barred: Barred,
) -> PartCall:
    """Return the call that overwrites the unconstrained a by the limited target.

    Args:
        M: Mass matrix, shape (nv, nv).
        a: The law's acceleration, and that of compensators, shape (nv,).
        effort: M a + N, and the compensators' effort, shape (nv,).
        parts: The law's acceleration, and its components.
        bounds: Bounds on the acceleration.
        permitted: The bounds to which excesses are relative.
        barred: Rows of barriers; ``lower`` then is for deviations from the new a.
    """
    return PartCall(
        engine.LimitedTarget,
        M=M,
        a=a,
        effort=effort,
        parts=parts,
        bounds=bounds,
        permitted=permitted,
        barred=barred,
        large=LARGE,
    )
