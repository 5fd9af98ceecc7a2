"""Weights of fields: constant, ramped in time, or of the state."""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from hsp_control.common.exceptions import FieldError
from hsp_control.null_space.differences import rate_along_flow
from hsp_control.robot import RobotState


class Weight(ABC):
    """A weight w(q, t) ≥ 0 that is continuous together with its rate.

    Attributes:
        constant: Whether it never changes.
    """

    constant: bool = False

    @abstractmethod
    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and w' = dw/dt."""


class ConstantWeight(Weight):
    """A number.

    Attributes:
        value: The number.
    """

    constant = True

    def __init__(self, value: float) -> None:
        """Set the number.

        Raises:
            FieldError: If it is negative or not finite.
        """
        self.value = _at_least_zero(value)

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return the number and 0."""
        return self.value, 0.0


class Ramp(Weight):
    """From one number to another over a time, twice continuously differentiable.

    w = a + (b - a)(10 s³ - 15 s⁴ + 6 s⁵), s = (t - start)/duration within 0 and 1.
    """

    def __init__(
        self, initial: float, final: float, *, start: float, duration: float
    ) -> None:
        """Set the ramp.

        Args:
            initial: w before, ≥ 0.
            final: w after, ≥ 0.
            start: When it begins [s].
            duration: How long it takes [s].

        Raises:
            FieldError: If a weight is negative or the duration not positive.
        """
        self.initial, self.final = _at_least_zero(initial), _at_least_zero(final)
        if not (0.0 < duration < np.inf and np.isfinite(start)):
            raise FieldError(
                f"a ramp from {start} s over {duration} s; needs a positive duration"
            )
        self.start, self.duration = float(start), float(duration)

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return the ramp's value and slope."""
        s = min(max((state.t - self.start) / self.duration, 0.0), 1.0)
        rise = self.final - self.initial
        slope = 30.0 * s * s * (1.0 - s) ** 2 / self.duration
        value = self.initial + rise * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        return value, rise * slope


class StateWeight(Weight):
    """A user's own function of the state; its rate by differences along the flow."""

    def __init__(self, function: Callable[[RobotState], float]) -> None:
        """Set the function: continuously differentiable, ≥ 0, of q and t alone."""
        self.function = function

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return the function's value and rate.

        Raises:
            FieldError: If the value is negative or not finite.
        """
        value = _at_least_zero(self.function(state))
        return value, float(rate_along_flow(self.function, state))


class Product(Weight):
    """The product of two weights."""

    def __init__(self, first: Weight, second: Weight) -> None:
        """Set the factors."""
        self.first, self.second = first, second
        self.constant = first.constant and second.constant

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return the product and its rate."""
        (a, a_dot), (b, b_dot) = self.first.sample(state), self.second.sample(state)
        return a * b, a_dot * b + a * b_dot


def as_weight(weight: "Weight | float") -> Weight:
    """Return a number as a constant weight, and a weight as it is."""
    return weight if isinstance(weight, Weight) else ConstantWeight(weight)


def _at_least_zero(value: float) -> float:
    if not 0.0 <= value < np.inf:
        raise FieldError(f"weight is {value}; must be at least 0")
    return float(value)
