"""Weights of fields: constant, ramped in time, or a function of the state."""

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from hsp_control.common.exceptions import FieldError
from hsp_control.null_space.differences import rate_along_flow
from hsp_control.robot import RobotState


class Weight(ABC):
    """w(q, t) ≥ 0: a weight of a field, continuous together with its rate w'.

    A subclass implements `sample`. If w never changes, it may set `constant` to True:
    a step plan then calls `sample` only once.

    Attributes:
        constant: Whether w never changes.
    """

    constant: bool = False

    @abstractmethod
    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w [-] and its total rate w' = ∂w/∂q·v + ∂w/∂t [1/s]."""


class ConstantWeight(Weight):
    """w = value, w' = 0.

    Attributes:
        value: w ≥ 0.
    """

    constant = True

    def __init__(self, value: float) -> None:
        """Set w.

        Raises:
            FieldError: If it is negative or not finite.
        """
        self.value = _non_negative(value)

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and 0; see `Weight.sample`."""
        return self.value, 0.0


class Ramp(Weight):
    """w = a + (b - a)(10 s³ - 15 s⁴ + 6 s⁵), s = (t - start)/duration within [0, 1].

    A smooth change from one weight to another, C² in t.

    Attributes:
        initial: a.
        final: b.
        start: Start of the ramp [s].
        duration: Duration of the ramp [s].
    """

    def __init__(
        self, initial: float, final: float, *, start: float, duration: float
    ) -> None:
        """Set the ramp.

        Args:
            initial: a ≥ 0, the weight before the ramp.
            final: b ≥ 0, the weight after the ramp.
            start: Start of the ramp [s].
            duration: Duration of the ramp > 0 [s].

        Raises:
            FieldError: If a weight is negative or not finite, the start is not finite,
                or the duration is not positive and finite.
        """
        self.initial, self.final = _non_negative(initial), _non_negative(final)
        if not (0.0 < duration < np.inf and np.isfinite(start)):
            raise FieldError(
                f"a ramp from {start} s over {duration} s; needs a finite start and a "
                "positive, finite duration"
            )
        self.start, self.duration = float(start), float(duration)

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and w'; see `Weight.sample`."""
        s = min(max((state.t - self.start) / self.duration, 0.0), 1.0)
        rise = self.final - self.initial
        slope = 30.0 * s * s * (1.0 - s) ** 2 / self.duration
        value = self.initial + rise * s**3 * (10.0 - 15.0 * s + 6.0 * s * s)
        return value, rise * slope


class StateWeight(Weight):
    """w = function(state), with w' by differences along the flow."""

    def __init__(self, function: Callable[[RobotState], float]) -> None:
        """Set the function.

        Args:
            function: w of a state, ≥ 0 and continuously differentiable; it may use q, t
                and frames, but not v.
        """
        self.function = function

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and w'; see `Weight.sample`.

        Raises:
            FieldError: If w is negative or not finite.
        """
        value = _non_negative(self.function(state))
        return value, float(rate_along_flow(self.function, state))


class Product(Weight):
    """w = a b, w' = a' b + a b': the product of two weights."""

    def __init__(self, first: Weight, second: Weight) -> None:
        """Set the factors."""
        self.first, self.second = first, second
        self.constant = first.constant and second.constant

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and w'; see `Weight.sample`."""
        (a, a_dot), (b, b_dot) = self.first.sample(state), self.second.sample(state)
        return a * b, a_dot * b + a * b_dot


def as_weight(weight: "Weight | float") -> Weight:
    """Return a number as a `ConstantWeight`, and a weight unchanged.

    Raises:
        FieldError: If a number is negative or not finite.
    """
    return weight if isinstance(weight, Weight) else ConstantWeight(weight)


def _non_negative(value: float) -> float:
    if not 0.0 <= value < np.inf:
        raise FieldError(f"weight is {value}; must be at least 0")
    return float(value)
