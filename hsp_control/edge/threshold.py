"""Where an inverse begins to be bounded: a threshold that follows the errors.

A level asks for J a = d. Along a direction of the singular value s it gets d/s where s
is above the threshold ε, and s (2 - s²/ε²) d/ε² below. The steepest of both is 2 d/ε²,
at s = 0. Let f = Kp s(e) be what the feedback asks for at rest, the part of d that
persists while a task cannot be met. With

    ε² = max(ε_0², ‖f‖/L)

the acceleration that it causes changes by at most 2 L for each unit of s, whatever the
target. A task that is tracked has f = 0 nearly, at any speed: for it the law is exact
down to ε_0. ``docs/edge.md`` has the propositions and where each constant is from.

How hard the spring at the edge draws is 2 L |∂s/∂q|. At a stretched elbow |∂s/∂q| is up
to a quarter of the robot's size. Where only a height counts, or x and y, it is up to
the whole size, and the spring moves the whole arm. So an error of one component gets a
third of L, one of two components half.

Below a level of the singular value s_1 the null space turns by up to |∂J/∂q|/s_1, and
what is asked for there with it. A level follows with L s_1/size where that is less; a
field costs a spring above it an ε that grows with g, as far as the spring slips.

A level that is held at its edge leaves to those below the very directions in which it
is drawn there: along them its spring must outweigh what they ask for. They ask for
f - J a_f, with a_f what those above draw at rest: a task that is met undoes it. So a
level below follows that with an L that is a fortieth, as far as the one above lacks
what it asks for.

All but ε_0 is meant for the identity as metric. Another one that makes J L⁻ᵀ longer
than J makes the same arm as steep at an ε that is larger.
"""

from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Array, Flags, Indices
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import squared_norm

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
since feet ask for that much where they land."""

TURNING, QUICKEST = 50.0, 7.0
"""How fast what a field asks for may change as its null space turns [1/s]: what is held
for a period h is stable below 2/h, and periods are up to 10 ms. No field counts for
more than 7 rad/s: none costs a spring all that it has."""


class Following(NamedTuple):
    """How the thresholds follow what is asked for."""

    size: float  # the robot's [m]; 0: they do not
    # L [rad/s² for each unit of a singular value]; inf: it does not follow
    steepest: float
    modest: float  # f_0 [m/s² or rad/s²]; 0 on a fixed base
    legs: bool  # whether the base floats

    @classmethod
    def of(cls, size: float, *, on_legs: bool) -> Self:
        """Return it for a robot of a size [m]."""
        if size == 0.0:
            return cls(*NOT)
        modest = size * MODEST_ON_LEGS if on_legs else 0.0
        return cls(size, STIFFNESS / size, modest, on_legs)


NOT = Following(0.0, np.inf, 0.0, False)  # nothing follows


class Thresholds(NamedTuple):
    """Where the inverses of the levels begin to be bounded, each of shape (levels,)."""

    own: Array  # ε of each level
    follows: Array  # the part of it that follows f
    scales: Array  # by how much J L⁻ᵀ is longer than J, at least 1: the unit of ε

    @classmethod
    def allocate(cls, levels: int) -> Self:
        """Return those of a number of levels."""
        return cls(*np.zeros((3, levels)))


@kernel
def turning_threshold(g: Array, following: Following) -> float:
    """Return the ε that a field g, shape (nv,), needs where a spring slips."""
    quickest = min(np.sqrt(squared_norm(g)), QUICKEST)
    return float(following.size / TURNING * quickest)


@kernel
def write_thresholds(
    J: Array,
    B: Array,
    asked: Array,
    yields: Array,
    pulls: Array,
    springs: Flags,
    ends: Indices,
    least: float,
    turning: float,
    following: Following,
    thresholds: Thresholds,
) -> float:
    """Write the threshold of each level.

    Args:
        J: The levels' Jacobians, one below the other, shape (m, nv).
        B: J L⁻ᵀ, shape (m, nv).
        asked: f, what the feedback asks for at rest, level after level, shape (m,).
        yields: By how much L is less for a row, shape (m,); 0: it does not count.
        pulls: With how much of its largest force a spring pulls, shape (m,).
        springs: Whether a row is that of a spring, shape (m,).
        ends: Where each level's rows end in the stack, shape (levels,).
        least: ε_0.
        turning: See `turning_threshold`; of springs that pull with all their force,
            and of others as much as they do of it.
        following: L and f_0.
        thresholds: Where they are written.

    Returns:
        A singular value of the stack from which on no level is bounded.
    """
    largest, start = least, 0
    above = 0.0  # the largest scale of those above
    for level in range(ends.shape[0]):
        square = more = pull = whitened = plain = 0.0
        sprung, tracks = True, False
        for k in range(start, ends[level]):
            sprung = sprung and springs[k]
            pull += pulls[k] * pulls[k]
            whitened += squared_norm(B[k])
            plain += squared_norm(J[k])
            if yields[k] > 0.0:
                tracks = True
                square += asked[k] * asked[k]
                more += (yields[k] - 1.0) * asked[k] * asked[k]
        scale = np.sqrt(max(whitened / plain, 1.0)) if plain > 0.0 else 1.0
        beyond = max(np.sqrt(square) - following.modest, 0.0)
        if beyond > 0.0:
            beyond *= 1.0 + more / square
        part = min(np.sqrt(pull), 1.0)
        follows = scale * np.sqrt(beyond / following.steepest)
        own = max(least, follows, scale * part * turning)
        largest = max(largest, own)
        if above > 0.0:
            # No s is below that of the stack: `threshold_below` is not above it then.
            turns = np.cbrt(follows * follows * following.size * above)
            largest = max(largest, turns)
        thresholds.own[level], thresholds.follows[level] = own, follows
        thresholds.scales[level] = scale
        above = max(above, scale) if sprung or tracks else above
        start = ends[level]
    return float(largest)


@kernel
def threshold_below(
    asked: Array,
    held: float,
    above: float,
    level: int,
    following: Following,
    thresholds: Thresholds,
) -> float:
    """Return the ε that a level below others has at least.

    Args:
        asked: f - J a_f of the level, shape (m,).
        held: How much levels above are held, see `how_held`.
        above: Their least singular value s_1, in their scale; inf: nobody turns.
        level: Which one.
        following: f_0 and L.
        thresholds: Those of `write_thresholds`.
    """
    beyond = max(np.sqrt(squared_norm(asked)) - following.modest, 0.0)
    scale, follows = thresholds.scales[level], thresholds.follows[level]
    square = scale * scale * held * BELOW * beyond / following.steepest
    return float(np.sqrt(square + follows * follows * following.size / above))


@kernel
def how_held(
    lacking: float, wanted: float, least: float, following: Following
) -> float:
    """Return how much a level is held at the edge, from 0 (exact) to nearly 1.

    It grows slowly as the level begins to ask for what its threshold follows: as fast
    as the level is lost to what is below it, both would swing from one to the other.

    Args:
        lacking: ‖f - J a_f‖², what the level does not get of what it asks for at rest.
        wanted: ‖f‖².
        least: ε_0.
        following: L and f_0.
    """
    beyond = np.sqrt(wanted) - following.modest
    if beyond <= 0.0:
        return 0.0
    lacks = min(np.sqrt(lacking / wanted), 1.0)
    slowly = following.steepest * least * least + following.modest
    return float(lacks * beyond / (beyond + slowly))
