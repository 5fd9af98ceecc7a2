"""How far active limits may change the tasks: the damped law, and slack priorities.

An arm at its workspace boundary, or moving fast towards it, commands more than its
motors supply, with alternating signs: the nearest step within the limits would
oscillate. So the damped law (`shares.py`) takes over in proportion to the excess E_t of
the tasks' part of a, and does so fully at E_t = 2. An excess is relative to the
permitted value: for an effort, its maximum; for an acceleration, that of the barriers
of `Limits` far from them.

A fast self-motion makes E_t large, too, though the tasks are met, and they would be
left to the field. So the share is at most r_f, the command of the errors alone relative
to the permitted one, which persists where tasks cannot be met and vanishes where they
are; and priorities are strict but for that. It is 1 where it is not known, of a task
with no largest error above all others. The engine has the equations.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.edge.bound_law import BoundLaw
from hsp_control.engine.plans import PartCall

LARGE = 2.0
"""Excess of the tasks above which the damped law applies fully: commands of three times
the permitted value."""


class Permitted(NamedTuple):
    """The bounds far from all limits, shapes (nv,); inf without one."""

    effort: Array  # [N·m or N]
    acceleration: Array  # [rad/s² or m/s²]
    bandwidth: float  # α of the barriers [1/s]

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
        return cls(np.array(effort), np.minimum(acceleration, most), float(bandwidth))


class Within(NamedTuple):
    """Bounds on the acceleration, shapes (nv,)."""

    lower: Array
    upper: Array


class Barred(NamedTuple):
    """Rows of barriers: A δ ≥ lower for a deviation δ from the unconstrained a."""

    A: Array  # shape (k, at least nv)
    lower: Array  # shape (k,)


class Shares(NamedTuple):
    """The share of the damped law and the slack, shapes (1,)."""

    by_limits: Array  # of the damped law in what the other shares leave
    slack: Array  # of priorities: 0 is strict


def limit_share(
    M: Array,
    a: Array,
    effort: Array,
    law: BoundLaw,
    self_motion: Array,
    at_rest: Array,
    bounds: Within,
    permitted: Permitted,
    barred: Barred,
) -> tuple[PartCall, Shares]:
    """Return the call that writes the shares, and its results.

    Args:
        M: Mass matrix, shape (nv, nv).
        a: The law's acceleration, and that of compensators, shape (nv,).
        effort: M a + N, and the compensators' effort, shape (nv,).
        law: The law.
        self_motion: φ_N, shape (nv,).
        at_rest: J# Kp s(e), the command of the errors alone, shape (nv,).
        bounds: Bounds on the acceleration.
        permitted: The bounds to which excesses are relative.
        barred: Rows of barriers, for deviations from a.
    """
    shares = Shares(np.zeros(1), np.zeros(1))
    call = PartCall(
        engine.LimitShare,
        M=M,
        a=a,
        effort=effort,
        self_motion=self_motion,
        at_rest=at_rest,
        pulls=law.problem.pulls,
        mu=law.edge.share,
        bounds=bounds,
        permitted=permitted,
        barred=barred,
        large=LARGE,
        least=0.0 if law.problem.demands_known else 1.0,
        share=shares.by_limits,
        slack=shares.slack,
    )
    return call, shares
