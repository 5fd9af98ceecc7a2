"""What a swept value may be: a list to choose from, or a probability distribution.

Each is given by its quantile function, so that every design (random, Latin hypercube,
Sobol) is a set of fractions in [0, 1) and knows nothing of distributions.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from scipy.special import ndtr, ndtri

from hsp_control.common.exceptions import SweepError

_LEAST, _MOST = 2.0**-53, 1.0 - 2.0**-53  # the normal's quantile is finite between


class Distribution(ABC):
    """Values that a parameter takes."""

    @abstractmethod
    def quantile(self, fraction: float) -> Any:
        """Return the value below which this fraction of all values lies.

        Args:
            fraction: In [0, 1).
        """

    def levels(self) -> tuple[Any, ...] | None:
        """Return all values, if they can be listed: what a grid is made of."""
        return None


@dataclass(frozen=True)
class Choices(Distribution):
    """One of a list of values (plain data of any kind), each as likely.

    Attributes:
        values: The values, at least one.
    """

    values: tuple[Any, ...]

    def __post_init__(self) -> None:
        """Refuse an empty list."""
        if not self.values:
            raise SweepError("there are no values to choose from")

    def quantile(self, fraction: float) -> Any:
        """Return one of the values."""
        return self.values[int(fraction * len(self.values))]

    def levels(self) -> tuple[Any, ...]:
        """Return the values."""
        return self.values


@dataclass(frozen=True)
class Uniform(Distribution):
    """Any number of an interval, each as likely.

    Attributes:
        low: Its lower end.
        high: Its upper end.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        """Refuse an interval without inside."""
        _check_interval(self.low, self.high)

    def quantile(self, fraction: float) -> float:
        """Return low + fraction (high - low)."""
        return self.low + fraction * (self.high - self.low)


@dataclass(frozen=True)
class LogUniform(Distribution):
    """A number whose logarithm is uniform: as often in 1 to 10 as in 10 to 100.

    Attributes:
        low: Its lower end, positive.
        high: Its upper end.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        """Refuse an interval without inside or logarithm."""
        _check_interval(self.low, self.high)
        _check_positive(self.low)

    def quantile(self, fraction: float) -> float:
        """Return low (high/low)^fraction."""
        return float(self.low * (self.high / self.low) ** fraction)


@dataclass(frozen=True)
class Normal(Distribution):
    """A normally distributed number, cut off where it would be senseless.

    Attributes:
        mean: Its mean before the cut.
        deviation: Its standard deviation before the cut, positive.
        low: What it never falls below.
        high: What it never exceeds.
    """

    mean: float
    deviation: float
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        """Refuse what is no normal distribution."""
        if not (math.isfinite(self.mean) and 0.0 < self.deviation < math.inf):
            raise SweepError(
                f"a normal distribution of mean {self.mean:g} and standard deviation "
                f"{self.deviation:g}: the deviation must be positive, both finite"
            )
        if not self.low < self.high:
            raise SweepError(f"cut off below {self.low:g} and above {self.high:g}")
        if not self._below(self.low) < self._below(self.high):
            raise SweepError(
                f"a normal distribution of mean {self.mean:g} and standard deviation "
                f"{self.deviation:g} has nothing from {self.low:g} to {self.high:g}"
            )

    def quantile(self, fraction: float) -> float:
        """Return the quantile of the normal distribution between the cuts."""
        below, above = self._below(self.low), self._below(self.high)
        inside = below + fraction * (above - below)
        value = self.mean + self.deviation * float(
            ndtri(min(max(inside, _LEAST), _MOST))
        )
        return float(min(max(value, self.low), self.high))

    def _below(self, value: float) -> float:
        return float(ndtr((value - self.mean) / self.deviation))


@dataclass(frozen=True)
class Integers(Distribution):
    """A whole number from low to high, both included: seeds, counts.

    Attributes:
        low: The least.
        high: The greatest.
    """

    low: int
    high: int

    def __post_init__(self) -> None:
        """Refuse ends in the wrong order."""
        if self.low > self.high:
            raise SweepError(f"there are no integers from {self.low} to {self.high}")

    def quantile(self, fraction: float) -> int:
        """Return a whole number."""
        return self.low + int(fraction * (self.high - self.low + 1))


def linear(low: float, high: float, count: int) -> Choices:
    """Return ``count`` evenly spaced numbers, both ends included.

    They are integers where both ends and the spacing are.
    """
    _check_interval(low, high)
    _check_count(count)
    steps = count - 1
    if isinstance(low, int) and isinstance(high, int) and (high - low) % steps == 0:
        return Choices(tuple(range(low, high + 1, (high - low) // steps)))
    inner = (low + (high - low) * (k / steps) for k in range(1, steps))
    return Choices((float(low), *inner, float(high)))


def logarithmic(low: float, high: float, count: int) -> Choices:
    """Return ``count`` numbers in a constant ratio, both ends included."""
    _check_interval(low, high)
    _check_positive(low)
    _check_count(count)
    steps = count - 1
    inner = (low * (high / low) ** (k / steps) for k in range(1, steps))
    return Choices((float(low), *inner, float(high)))


def _check_interval(low: float, high: float) -> None:
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise SweepError(
            f"the interval from {low:g} to {high:g}: its ends must be finite and the "
            "first below the second"
        )


def _check_positive(low: float) -> None:
    if low <= 0.0:
        raise SweepError(f"begins at {low:g}; a logarithmic range must be positive")


def _check_count(count: int) -> None:
    if count < 2:
        raise SweepError(f"has {count} values; a range has at least 2")
