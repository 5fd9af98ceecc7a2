"""The cost of deviations while limits make tasks infeasible, level by level.

While a limit is active, lower priorities deviate before a level does. The direction of
their deviation depends on the posture: the more, the smaller their mobility along the
limit and the smaller their cost. For a task that cannot be met the demand persists: so
the cost ρ follows the command beyond the limit, as ε follows f (`threshold.py`), and
the tiny ρ of strict priorities applies to feasible tasks, and to directions of large
mobility. ``docs/edge.md`` has the proof, the call the equations.
"""

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.edge.bound_law import BoundLaw
from hsp_control.edge.excess import StepLimits, Wanted
from hsp_control.edge.step import ByLevels
from hsp_control.engine.plans import PartCall

STIFFEST = 1000.0
"""K [1/s²], the maximum change of a deviation per radian of rotation of its direction.
A sampled loop tolerates k h < 2 c, that is 2000 1/s² with a null-space gain of 10 1/s
and periods of up to 10 ms: K is half of it."""


def held_levels(
    wanted: Wanted,
    v: Array,
    law: BoundLaw,
    parts: ByLevels,
    slack: Array,
    limits: StepLimits,
) -> tuple[PartCall, Array]:
    """Return the call that writes the minimum costs below each level.

    Args:
        wanted: The law's command.
        v: Velocity, shape (nv,).
        law: The law.
        parts: Contributions of the first levels to it.
        slack: Of the priorities, shape (1,); see `limit_share`.
        limits: The limits of the step.

    Returns:
        The call, and its result, shape (levels,): ρ for the first levels' command
        beyond limits, 0 without one. It may be more than 1.
    """
    held, metric = np.zeros(len(law.ends)), law.problem.metric
    call = PartCall(
        engine.HeldLevels,
        wanted=wanted,
        L=metric.L,
        form=law.form,
        v=v,
        law=law.acceleration,
        **parts._asdict(),
        ends=law.ends,
        thresholds=law.thresholds,
        units=law.units,
        slack=slack,
        limits=limits,
        stiffest=STIFFEST,
        held=held,
    )
    return call, held
