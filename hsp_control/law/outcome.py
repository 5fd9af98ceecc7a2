"""What became of the law at one state."""

from enum import IntEnum


class Outcome(IntEnum):
    """Whether the law's equations hold."""

    EXACT = 0
    """They do: all singular values are above the threshold."""
    DAMPED = 1
    """A singular value is below the threshold: the inverse was bounded instead."""
    NOT_FINITE = 2
    """The acceleration contains NaN or inf."""


OUTCOMES = tuple(Outcome)
"""By number: a native call returns floats."""
