"""How many equal steps an interval of time is divided into."""

from math import ceil


def number_of_steps(duration: float, step: float) -> int:
    """Return the smallest number of equal steps that are not longer than ``step``."""
    return max(1, ceil(duration / step - 1e-9))
