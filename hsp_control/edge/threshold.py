"""The threshold below which an inverse is bounded: the constants, and their origin.

The mathematics is in the engine, ``engine/edge/threshold.hpp``.

A level commands J a = d. Along a direction of the singular value s the acceleration is
d/s where s is above the threshold ε, and s (2 - s²/ε²) d/ε² below. The largest slope of
both in s is 2 d/ε², at s = 0. Let f = Kp s(e) be the feedback's command at rest, the
part of d that persists while a task cannot be met. With

    ε² = max(ε_0², ‖f‖/L)

the acceleration due to f changes by at most 2 L per unit of s, for any target. A
tracked task has nearly f = 0, at any speed: for it the law is exact down to ε_0.
``docs/edge.md`` has the propositions and the origin of each constant.

The equivalent stiffness at the workspace boundary is 2 L |∂s/∂q|. At a stretched elbow
|∂s/∂q| is up to a quarter of the robot's size. Where only a height is controlled, or x
and y, it is up to the whole size, and the equivalent spring moves the whole arm. So for
an error of one component a third of L is used, for two components half.

Below a level of the singular value s_1 the null space rotates by up to |∂J/∂q|/s_1, and
so do the commands in it. A lower level uses L s_1/size if that is less; a field below a
saturated spring needs an ε that grows with g.

An unmet level at its workspace boundary releases to lower levels the directions in
which it pulls towards its target: along them its equivalent spring must outweigh their
commands. They command f - J a_f, with a_f the acceleration of the higher levels at
rest, which a met task compensates. So a lower level uses a fortieth of L, in proportion
to the unmet command of the level above.

All but ε_0 are for the identity as metric. In another one the rows of J L⁻ᵀ have
another length than those of J, and the singular values are in units of their ratio, for
each position and each orientation on its own: with W = M(q) the rows of an orientation
are long, since wrists are light.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.edge.shares import FAR, NEAR

STIFFNESS = 200.0
"""L times the robot's size [1/s²]. A stretched elbow is then pulled to its singular
posture by a spring of at most 2 L |∂s/∂q| ≤ 100 1/s² times its inertia, 10 rad/s: slow
relative to periods of up to 10 ms and to the motors' efforts, and damped by a
null-space gain of 10 1/s."""
WHOLE = 3
"""Number of components of an error with the full L; with m < 3 components it is L/(4 -
m)."""
BELOW = 40.0
"""Factor of L below an unmet level: its feedback then accelerates a joint by at most
1/40 of the spring of the level above."""
MODEST_ON_LEGS = 10.0
"""f_0 over the robot's size [1/s²] with a floating base: ε follows ‖f‖ - f_0 there,
since feet command that much at touchdown."""

TURNING, QUICKEST = 50.0, 7.0
"""Maximum rate of a field's command as its null space rotates [1/s]: held for a period
h it is stable below 2/h, and periods are up to 10 ms. At most 7 rad/s of a field are
used: a larger field would damp a spring in all directions."""


class Following(NamedTuple):
    """Parameters of the thresholds, and of the range of the exact law."""

    size: float  # the robot's [m]; 0: they do not
    # L [rad/s² per unit of a singular value]; inf: it does not follow
    steepest: float
    modest: float  # f_0 [m/s² or rad/s²]; 0 on a fixed base
    below: float  # factor of L below an unmet level
    turning: float  # ε per rad/s of a field while a spring is saturated
    quickest: float  # the largest used size of a field [rad/s]
    near: float  # σ_x: the exact law applies fully above
    far: float  # fraction of the largest error up to which it applies fully

    @classmethod
    def of(cls, size: float, *, on_legs: bool) -> Self:
        """Return the parameters for a robot's size [m]; 0: constant thresholds."""
        modest = size * MODEST_ON_LEGS if on_legs else 0.0
        steepest = STIFFNESS / size if size else np.inf
        return cls(
            size, steepest, modest, BELOW, size / TURNING, QUICKEST, NEAR * size, FAR
        )


NOT = Following.of(0.0, on_legs=False)  # no threshold follows commands


class Thresholds(NamedTuple):
    """The thresholds of the levels' inverses."""

    own: Array  # ε of each level, shape (levels,)
    follows: Array  # the part of it that follows f, shape (levels,)
    units: Array  # D, the unit of singular values for each row, shape (m,)

    @classmethod
    def allocate(cls, levels: int, rows: int) -> Self:
        """Return the thresholds of a number of levels with m ``rows``."""
        return cls(np.zeros(levels), np.zeros(levels), np.ones(rows))
