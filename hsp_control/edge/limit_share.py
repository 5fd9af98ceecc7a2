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

from typing import NamedTuple

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.edge.bound_law import BoundLaw
from hsp_control.edge.excess import StepLimits, Wanted
from hsp_control.engine.plans import PartCall

LARGE = 2.0
"""Excess of the tasks above which the damped law applies fully: commands of three times
the permitted value."""


class Shares(NamedTuple):
    """The share of the damped law and the slack, shapes (1,)."""

    by_limits: Array  # of the damped law in what the other shares leave
    slack: Array  # of priorities: 0 is strict


def limit_share(
    wanted: Wanted,
    law: BoundLaw,
    self_motion: Array,
    at_rest: Array,
    limits: StepLimits,
) -> tuple[PartCall, Shares]:
    """Return the call that writes the shares, and its results.

    Args:
        wanted: The law's command.
        law: The law.
        self_motion: φ_N, shape (nv,).
        at_rest: J# Kp s(e), the command of the errors alone, shape (nv,).
        limits: The limits of the step.
    """
    shares = Shares(np.zeros(1), np.zeros(1))
    call = PartCall(
        engine.LimitShare,
        wanted=wanted,
        self_motion=self_motion,
        at_rest=at_rest,
        pulls=law.problem.pulls,
        mu=law.edge.share,
        limits=limits,
        large=LARGE,
        least=0.0 if law.problem.demands_known else 1.0,
        share=shares.by_limits,
        slack=shares.slack,
    )
    return call, shares
