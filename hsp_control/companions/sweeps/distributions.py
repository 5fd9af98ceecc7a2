"""The values of a swept parameter: a list of choices, or a probability distribution.

Each is defined by its quantile function. A design (random, Latin hypercube, Sobol) is
then only a set of fractions in [0, 1), independent of the distributions.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any

from scipy.special import ndtr, ndtri

from hsp_control.common.exceptions import SweepError

_LOWEST, _HIGHEST = 2.0**-53, 1.0 - 2.0**-53  # the normal quantile is finite here


class Distribution(ABC):
    """The values of a parameter."""

    @abstractmethod
    def quantile(self, fraction: float) -> Any:
        """Return the quantile: the value below which this fraction of all values lies.

        Args:
            fraction: In [0, 1).
        """

    def levels(self) -> tuple[Any, ...] | None:
        """Return all values for a grid; None if they cannot be listed."""
        return None


@dataclass(frozen=True)
class Choices(Distribution):
    """One of a list of values (plain data of any kind), all equally likely.

    Attributes:
        values: The values, at least one.
    """

    values: tuple[Any, ...]

    def __post_init__(self) -> None:
        """Check that there is a value."""
        if not self.values:
            raise SweepError("the list of values is empty")

    def quantile(self, fraction: float) -> Any:
        """Return one of the values."""
        return self.values[int(fraction * len(self.values))]

    def levels(self) -> tuple[Any, ...]:
        """Return the values."""
        return self.values


@dataclass(frozen=True)
class Uniform(Distribution):
    """A number of an interval, uniformly distributed.

    Attributes:
        low: Lower end.
        high: Upper end.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        """Check that the ends are finite, and low is below high."""
        _check_interval(self.low, self.high)

    def quantile(self, fraction: float) -> float:
        """Return low + fraction (high - low)."""
        return self.low + fraction * (self.high - self.low)


@dataclass(frozen=True)
class LogUniform(Distribution):
    """A number with a uniform logarithm: 1 to 10 is as likely as 10 to 100.

    Attributes:
        low: Lower end, positive.
        high: Upper end.
    """

    low: float
    high: float

    def __post_init__(self) -> None:
        """Check that the ends are finite and positive, and low is below high."""
        _check_interval(self.low, self.high)
        _check_positive(self.low)

    def quantile(self, fraction: float) -> float:
        """Return low (high/low)^fraction."""
        return float(self.low * (self.high / self.low) ** fraction)


@dataclass(frozen=True)
class Normal(Distribution):
    """A normally distributed number, truncated to an interval.

    Attributes:
        mean: Mean before truncation.
        deviation: Standard deviation before truncation, positive.
        low: Lower end of the interval.
        high: Upper end of the interval.
    """

    mean: float
    deviation: float
    low: float = -math.inf
    high: float = math.inf

    def __post_init__(self) -> None:
        """Check the numbers, and that the interval has a positive probability."""
        if not (math.isfinite(self.mean) and 0.0 < self.deviation < math.inf):
            raise SweepError(
                f"a normal distribution of mean {self.mean:g} and standard deviation "
                f"{self.deviation:g}; both must be finite, the deviation positive"
            )
        if not self.low < self.high:
            raise SweepError(
                f"a normal distribution is cut to {self.low:g} ... {self.high:g}; "
                "low must be below high"
            )
        if not self._below(self.low) < self._below(self.high):
            raise SweepError(
                f"a normal distribution of mean {self.mean:g} and standard deviation "
                f"{self.deviation:g} has no values from {self.low:g} to {self.high:g}"
            )

    def quantile(self, fraction: float) -> float:
        """Return the quantile of the truncated normal distribution."""
        below, above = self._below(self.low), self._below(self.high)
        inside = below + fraction * (above - below)
        value = self.mean + self.deviation * float(
            ndtri(min(max(inside, _LOWEST), _HIGHEST))
        )
        return float(min(max(value, self.low), self.high))

    def _below(self, value: float) -> float:
        return float(ndtr((value - self.mean) / self.deviation))


@dataclass(frozen=True)
class Integers(Distribution):
    """An integer from low to high, both included: for seeds and counts.

    Attributes:
        low: Smallest integer.
        high: Largest integer.
    """

    low: int
    high: int

    def __post_init__(self) -> None:
        """Check that low is not above high."""
        if self.low > self.high:
            raise SweepError(f"there are no integers from {self.low} to {self.high}")

    def quantile(self, fraction: float) -> int:
        """Return an integer."""
        return self.low + int(fraction * (self.high - self.low + 1))


def linear(low: float, high: float, count: int) -> Choices:
    """Return ``count`` evenly spaced numbers, both ends included.

    They are integers if both ends and the spacing are integers.
    """
    _check_interval(low, high)
    _check_count(count)
    steps = count - 1
    if isinstance(low, int) and isinstance(high, int) and (high - low) % steps == 0:
        return Choices(tuple(range(low, high + 1, (high - low) // steps)))
    inner = (low + (high - low) * (k / steps) for k in range(1, steps))
    return Choices((float(low), *inner, float(high)))


def logarithmic(low: float, high: float, count: int) -> Choices:
    """Return ``count`` numbers with a constant ratio, both ends included."""
    _check_interval(low, high)
    _check_positive(low)
    _check_count(count)
    steps = count - 1
    inner = (low * (high / low) ** (k / steps) for k in range(1, steps))
    return Choices((float(low), *inner, float(high)))


def _check_interval(low: float, high: float) -> None:
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        raise SweepError(
            f"the interval is from {low:g} to {high:g}; its ends must be finite, and "
            "the first below the second"
        )


def _check_positive(low: float) -> None:
    if low <= 0.0:
        raise SweepError(
            f"the range begins at {low:g}; a logarithmic range must be positive"
        )


def _check_count(count: int) -> None:
    if count < 2:
        raise SweepError(f"the range has {count} values; must have at least 2")
