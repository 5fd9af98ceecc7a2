"""Where an inverse begins to be bounded: the constants, and their origin.

The mathematics is in the engine, ``engine/edge/threshold.hpp``.

A level commands J a = d. Along a direction of the singular value s it gets d/s where s
is above the threshold ε, and s (2 - s²/ε²) d/ε² below. The steepest of both is 2 d/ε²,
at s = 0. Let f = Kp s(e) be the feedback's command at rest, the part of d that
persists while a task cannot be met. With

    ε² = max(ε_0², ‖f‖/L)

the acceleration that it causes changes by at most 2 L for each unit of s, whatever the
target. A task that is tracked has f = 0 nearly, at any speed: for it the law is exact
down to ε_0. ``docs/edge.md`` has the propositions and the origin of each constant.

The stiffness of the spring at the edge is 2 L |∂s/∂q|. At a stretched elbow |∂s/∂q| is
up to a quarter of the robot's size. Where only a height is controlled, or x and y, it
is up to the whole size, and the spring moves the whole arm. So an error of one
component gets a third of L, one of two components half.

Below a level of the singular value s_1 the null space turns by up to |∂J/∂q|/s_1, and
what is commanded there with it. A level follows with L s_1/size where that is less; a
field costs a spring above it an ε that grows with g, as far as the spring slips.

A level that is held at its edge releases to those below the very directions in which it
is drawn there: along them its spring must outweigh their commands. They command f - J
a_f, with a_f the acceleration of those above at rest: a task that is met compensates
it. So a level below follows that with an L that is a fortieth, as far as the one above
misses its command.

All but ε_0 is meant for the identity as metric. Another one that makes J L⁻ᵀ longer
than J makes the same arm as steep at an ε that is larger.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.edge.shares import FAR, NEAR

STIFFNESS = 200.0
"""L times the robot's size [1/s²]. A stretched elbow is then drawn to its singular
posture by a spring of at most 2 L |∂s/∂q| ≤ 100 1/s² of its own inertia, 10 rad/s: slow
beside periods of up to 10 ms and what motors can give, and damped by a null-space gain
of 10 1/s."""
WHOLE = 3
"""Components of an error to which all of L belongs, one of m < 3 gets L/(4 - m)."""
BELOW = 40.0
"""By how much L is less below a held level: its feedback then accelerates a joint by at
most 1/40 of the spring of the level above."""
MODEST_ON_LEGS = 10.0
"""f_0 over the robot's size [1/s²] with a floating base: ε follows ‖f‖ - f_0 there,
since feet command that much where they land."""

TURNING, QUICKEST = 50.0, 7.0
"""How fast a field's command may change as its null space turns [1/s]: held for a
period h it is stable below 2/h, and periods are up to 10 ms. At most 7 rad/s of a field
are used: a larger field would damp a spring in all directions."""


class Following(NamedTuple):
    """How the thresholds follow what is commanded, and when the exact law applies."""

    size: float  # the robot's [m]; 0: they do not
    # L [rad/s² for each unit of a singular value]; inf: it does not follow
    steepest: float
    modest: float  # f_0 [m/s² or rad/s²]; 0 on a fixed base
    below: float  # by how much L is less below a held level
    turning: float  # ε for each rad/s of a field where a spring slips
    quickest: float  # the largest part of a field that is used [rad/s]
    near: float  # σ_x: the exact law applies wholly above
    far: float  # part of the largest error up to which it applies wholly

    @classmethod
    def of(cls, size: float, *, on_legs: bool) -> Self:
        """Return it for a robot of a size [m]; for 0 nothing follows."""
        modest = size * MODEST_ON_LEGS if on_legs else 0.0
        steepest = STIFFNESS / size if size else np.inf
        return cls(
            size, steepest, modest, BELOW, size / TURNING, QUICKEST, NEAR * size, FAR
        )


NOT = Following.of(0.0, on_legs=False)  # nothing follows


class Thresholds(NamedTuple):
    """Where the inverses of the levels begin to be bounded, each of shape (levels,)."""

    own: Array  # ε of each level
    follows: Array  # the part of it that follows f
    scales: Array  # by how much J L⁻ᵀ is longer than J, at least 1: the unit of ε

    @classmethod
    def allocate(cls, levels: int) -> Self:
        """Return those of a number of levels."""
        return cls(*np.zeros((3, levels)))
