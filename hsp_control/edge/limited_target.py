"""The acceleration that a step approximates while a limit is active.

While a limit is active the law's equations cannot hold. Then it is decomposed,

    a = a_t + φ_N,

into the tasks' part and the self-motion (`self_motion.py`). Two things change, as
continuous functions of the state. The tasks are damped, with the share of the limits in
μ (`limit_share.py`). And the field's command is bounded. That is φ_N + P K_N P v, the
self-motion without its damping. A field's command is unbounded; at most the value that
the limits permit far from them is passed to the QP; damping is not scaled, or the null
space would oscillate at the limits. A field keeps at least 1/(1 + E), with the excess E
of the command: one that is reduced by more than its excess oscillates there.
"""

from typing import NamedTuple

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.edge.excess import StepLimits, Wanted
from hsp_control.engine.plans import PartCall


class Parts(NamedTuple):
    """The law's acceleration and the damped law's, and their components."""

    law: Array  # shapes (nv,)
    damped: Array
    law_self_motion: Array  # φ_N
    damped_self_motion: Array
    law_braking: Array  # P K_N P v
    damped_braking: Array


def limited_target(
    wanted: Wanted, parts: Parts, limits: StepLimits, share: Array
) -> PartCall:
    """Return the call that overwrites the unconstrained a by the limited target.

    Args:
        wanted: The law's command; its acceleration and its effort are overwritten.
        parts: The law's acceleration, and its components.
        limits: The limits of the step; ``least`` then is for deviations from the new a.
        share: That of the damped law by limits, shape (1,).
    """
    return PartCall(
        engine.LimitedTarget, wanted=wanted, parts=parts, limits=limits, share=share
    )
