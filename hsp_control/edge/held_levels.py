"""What yielding costs where limits hold the tasks, level by level.

Where a limit is active, what is below a level yields before the level does. The
direction in which it yields turns with the posture, the more the less it can yield and
the cheaper it is. A task that cannot be met demands it forever: so the cost ρ follows
what is commanded beyond the limit, as ε follows f (`threshold.py`), and the tiny ρ of
strict priorities is for feasible tasks, and for what yields easily. ``docs/edge.md``
has the proof, the call the equations.
"""

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.edge.bound_law import BoundLaw
from hsp_control.edge.limited_target import Barred, Within
from hsp_control.edge.step import Factors
from hsp_control.engine.plans import PartCall

STIFFEST = 1000.0
"""K [1/s²], the most that a deviation changes for each radian by which its direction
turns. A sampled loop tolerates k h < 2 c, that is 2000 1/s² with a null-space gain of
10 1/s and periods of up to 10 ms: K is half of it."""


def held_levels(
    M: Array,
    a: Array,
    effort: Array,
    law: BoundLaw,
    by_levels: Array,
    factors: Factors,
    bounds: Within,
    permitted: Array,
    barred: Barred,
) -> tuple[PartCall, Array]:
    """Return the call that writes the least costs of what is below each level.

    Args:
        M: Mass matrix, shape (nv, nv).
        a: The law's acceleration, and that of compensators, shape (nv,).
        effort: M a + N, and the compensators' effort, shape (nv,).
        law: The law.
        by_levels: The part of the first k levels in it, shape (levels, nv).
        factors: Orthonormal rows Q = X J L⁻ᵀ of all levels, X lower triangular.
        bounds: Bounds on the acceleration.
        permitted: Maximum efforts, inf where there is no limit, shape (nv,).
        barred: Rows of barriers, for deviations from a.

    Returns:
        The call, and what it writes, shape (levels,): ρ for what the first levels
        command beyond limits, 0 if that is nothing. It may be more than 1.
    """
    held, metric = np.zeros(len(by_levels)), law.problem.metric
    call = PartCall(
        engine.HeldLevels,
        M=M,
        L=metric.L,
        form=law.form,
        a=a,
        effort=effort,
        law=law.acceleration,
        by_levels=by_levels,
        factors=factors,
        ends=law.ends,
        thresholds=law.thresholds,
        bounds=bounds,
        permitted=permitted,
        barred=barred,
        stiffest=STIFFEST,
        held=held,
    )
    return call, held
