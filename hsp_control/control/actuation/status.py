"""The status of a step: how much of the law the actuation delivers."""

from enum import IntEnum


class Status(IntEnum):
    """How much of the law's acceleration is delivered within the limits."""

    EXACT = 0
    """All of it, with contact forces of minimum norm."""
    REDISTRIBUTED = 1
    """All of it, with contact forces chosen by a QP."""
    LIMITED = 2
    """The nearest acceleration within the limits. All of them are kept as far as the
    model goes: whether a joint is beyond one, say the columns ``position_excess`` and
    ``velocity_excess`` of the log, whatever the status."""
    RELAXED = 3
    """The limits contradict each other: they are relaxed as little as possible."""


EXACT, LIMITED, RELAXED = Status.EXACT, Status.LIMITED, Status.RELAXED
"""For the step: up to Python 3.11 `Status.EXACT` takes 80 ns."""
