"""Where an inverse begins to be bounded: a threshold that follows the errors.

A level asks for J a = d. Along a direction of the singular value s it gets d/s where s
is above the threshold ε, and s (2 - s²/ε²) d/ε² below. The steepest of both is 2 d/ε²,
at s = 0. Let f = Kp s(e) be what the feedback asks for at rest, the part of d that
persists while a task cannot be met. With

    ε² = max(ε_0², (‖f‖ - f_0)/L)

the acceleration that it causes changes by at most 2 (L + f_0/ε_0²) for each unit of s,
whatever the target. A task that is tracked has f = 0 nearly, at any speed: for it the
law is exact down to ε_0. ``docs/law.md``, The edge, has the proposition.

How hard the spring at the edge draws is 2 L |∂s/∂q|. At a stretched elbow |∂s/∂q| is up
to a quarter of the robot's size. Where only a height counts, or x and y, it is up to
the whole size, and the spring moves the whole arm. So an error of one component gets a
third of L, one of two components half.

A level that is held at its edge leaves to those below the very directions in which it
is drawn there: along them its spring must outweigh what they ask for. They ask for
f - J a_f, with a_f what those above draw at rest: a task that is met undoes it. So a
level below follows that with an L that is a fiftieth: it is as steep as it is strong,
and the less the level above gets of what it asks for, the less it gets there.

A level of springs asks for as little at its edge as it can have: that fades with its
mobility. But the directions in which it pulls in vain turn as 1/s, and all below with
them. So it lends them to that, as far as it pulls, from four times its own ε on.

The null space turns by at most 1.09 |∂J/∂q|/ε: where an arm is held ε grows with g.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import squared_norm

STIFFNESS = 200.0
"""L times the robot's size [1/s²]. A stretched elbow is then drawn to its singular
posture by a spring of at most 2 L |∂s/∂q| ≤ 100 1/s² of its own inertia, 10 rad/s: slow
beside periods of up to 10 ms and what motors can give, and damped by a null-space gain
of 10 1/s."""
WHOLE, TURNS = 3, 0.8
"""Components of an error to which all of L belongs, one of m < 3 gets L/(4 - m); and by
how much L is less for an orientation, whose error of 1 rad asks for thrice as much as
the largest of a position."""
BELOW = 4.0
"""L times the robot's size below a held level [1/s²]. Its feedback then accelerates a
joint by at most 2 L s, 1/50 of the spring of the level above."""
MODEST, MODEST_ON_LEGS = 1.0, 10.0
"""f_0 over the robot's size [1/s²]: what a position 1 % of the size away asks for at
10 rad/s; and with a floating base, whose feet ask for more where they land."""

TURNING, QUARTER, QUICKEST = 50.0, 0.25, 7.0
"""How fast what a field asks for may change as its null space turns [1/s]: what is held
for a period h is stable below 2/h, and periods are up to 10 ms. A velocity counts for a
quarter, and nothing for more than 7 rad/s: no field costs the task all that it has."""

SPRING = 0.4
"""ε, over the robot's size, from which a level lends its directions whose springs pull
with all their force: that of a feedback with its largest error."""
KEPT = 0.25
"""A level of springs keeps its own force down to this part of that ε."""
WEAKEST = 0.02
"""Springs that pull with less than this part of their force hold as those with it."""
HALF = 5.0
"""How many times f_0 a level asks for beyond it where it is held by half."""


class Following(NamedTuple):
    """How the threshold follows what is asked for."""

    # L [rad/s² for each unit of a singular value]; inf: it does not follow
    steepest: float
    modest: float  # f_0 [m/s² or rad/s²]
    below: float  # L of a level below a held one
    turning: float  # ε for each rad/s of a field, where an arm is held [s]
    spring: float  # ε from which springs lend what they pull at with all their force

    @classmethod
    def of(cls, size: float, *, on_legs: bool) -> Self:
        """Return it for a robot of a size [m]."""
        if size == 0.0:
            return cls(*NOT)
        modest = MODEST_ON_LEGS if on_legs else MODEST
        below, turning, spring = BELOW / size, size / TURNING, SPRING * size
        return cls(STIFFNESS / size, size * modest, below, turning, spring)


NOT = Following(np.inf, 0.0, np.inf, 0.0, 0.0)
"""The threshold does not follow."""


@kernel
def turning_threshold(g: Array, v: Array, following: Following) -> float:
    """Return the ε that a field and a speed need where an arm is held.

    Args:
        g: The field, shape (nv,).
        v: The velocity, shape (nv,).
        following: What they count.
    """
    quickest = max(np.sqrt(squared_norm(g)), QUARTER * np.sqrt(squared_norm(v)))
    return float(following.turning * min(quickest, QUICKEST))


@kernel
def write_thresholds(
    asked: Array,
    yields: Array,
    pulls: Array,
    springs: Flags,
    ends: Indices,
    least: float,
    turning: float,
    following: Following,
    thresholds: Array,
    lends: Array,
) -> float:
    """Write ε of each level, and return the largest.

    Args:
        asked: f, what the feedback asks for at rest, level after level, shape (m,).
        yields: By how much L is less for a row, shape (m,); 0: it does not count.
        pulls: With how much of its largest force a spring pulls, shape (m,).
        springs: Whether a row is that of a spring, shape (m,).
        ends: Where each level's rows end in the stack, shape (levels,).
        least: ε_0.
        turning: See `turning_threshold`; for levels that ask for f_0, or springs that
            pull with all their force, and for others as much as they do of it.
        following: L and f_0.
        thresholds: ε of each level, shape (levels,).
        lends: ε from which a level of springs lends its directions to those below,
            shape (levels,); 0: it does not.
    """
    largest, start, several = least, 0, ends.shape[0] > 1
    for level in range(ends.shape[0]):
        square = more = pull = 0.0
        sprung = several
        for k in range(start, ends[level]):
            sprung = sprung and springs[k]
            pull += pulls[k] * pulls[k]
            if yields[k] > 0.0:
                square += asked[k] * asked[k]
                more += (yields[k] - 1.0) * asked[k] * asked[k]
        norm, share = np.sqrt(square), np.sqrt(pull)
        if following.modest > 0.0:
            share = max(share, norm / following.modest)
        beyond = max(norm - following.modest, 0.0)
        if beyond > 0.0:
            beyond *= 1.0 + more / square
        follows = np.sqrt(beyond / following.steepest)
        turns = min(share, 1.0) * turning
        lends[level] = following.spring * np.sqrt(min(share, 1.0)) if sprung else 0.0
        thresholds[level] = max(least, follows, turns, KEPT * lends[level])
        largest = max(largest, thresholds[level], lends[level])
        start = ends[level]
    return float(largest)


@kernel
def threshold_below(asked: Array, held: float, following: Following) -> float:
    """Return the ε that a level below a held one has at least.

    Args:
        asked: f - J a_f of the level, shape (m,).
        held: How much levels above are held, see `how_held` and `held_by_springs`.
        following: f_0 and L.
    """
    square = 0.0
    for k in range(asked.shape[0]):
        square += asked[k] * asked[k]
    beyond = max(np.sqrt(square) - following.modest, 0.0)
    return float(np.sqrt(held * beyond / following.below))


@kernel
def how_held(lacking: float, wanted: float, following: Following) -> float:
    """Return how much a level is held at the edge, from 0 (exact) to nearly 1.

    It grows slowly as the level begins to ask for more than f_0: as fast as the level
    is lost to what is below it, both would swing from one to the other.

    Args:
        lacking: ‖f - J a_f‖², what the level does not get of what it asks for at rest.
        wanted: ‖f‖².
        following: f_0.
    """
    beyond = np.sqrt(wanted) - following.modest
    if beyond <= 0.0:
        return 0.0
    got = (1.0 - min(np.sqrt(lacking / wanted), 1.0)) ** 5
    half, square = HALF * following.modest, beyond * beyond
    return float((1.0 - got) * square / (square + half * half))


@kernel
def held_by_springs(smallest: float, lends: float, following: Following) -> float:
    """Return how much a level of springs is held, 1 or more at its very edge.

    The weaker they pull, the more they count: what is below must be weaker still.

    Args:
        smallest: The smallest x = s².
        lends: From which s the level lends its directions.
        following: That of springs with all their force.
    """
    x, square = following.spring * following.spring, lends * lends
    if smallest >= square:
        return 0.0
    return float((1.0 - (smallest / square) ** 3) * x / max(square, WEAKEST * x))
