"""Whether the law's equations hold, as reported by the engine."""

from enum import IntEnum
from typing import NamedTuple, Self

import numpy as np

from hsp_control.common.arrays import Indices


class Outcome(IntEnum):
    """Whether the law's equations hold."""

    EXACT = 0
    """The equations hold: all singular values are above the threshold."""
    DAMPED = 1
    """A singular value is below the threshold: the inverse was bounded instead."""
    NOT_FINITE = 2
    """The acceleration contains NaN or inf."""


EXACT, DAMPED, NOT_FINITE = tuple(Outcome)
"""By name, for the step: up to Python 3.11 `Outcome.EXACT` takes 80 ns."""


class LawOutcome(NamedTuple):
    """The law's outcome in a step, which the engine writes, shapes (1,)."""

    damped_level: Indices
    """The first level whose inverse is bounded, from 1 on; 0: none is."""
    finite: Indices
    """Whether the acceleration is finite: 0 or 1."""

    @classmethod
    def allocate(cls) -> Self:
        """Return the outcome of a law that is not resolved yet."""
        return cls(*np.zeros((2, 1), dtype=np.int64))

    @property
    def outcome(self) -> Outcome:
        """Whether the equations hold."""
        if not self.finite[0]:
            return NOT_FINITE
        return DAMPED if self.damped_level[0] else EXACT
