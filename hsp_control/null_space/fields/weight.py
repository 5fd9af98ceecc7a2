"""Weights of fields: constant, ramped in time, or a function of the state."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY, replace

import numpy as np
from pydantic import InstanceOf

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FieldError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import NonNegative, Number, Positive
from hsp_control.engine.plans import PartCall, PartCalls, implemented_by
from hsp_control.robot import RobotState
from hsp_control.robot.differences import rate_along_flow


class Weight(Part, ABC, error=FieldError):
    """w(q, t) ≥ 0: a weight of a field, continuous together with its rate w'.

    A subclass implements `sample`. If w never changes, it may set `constant` to True:
    a step plan then calls `sample` only once.
    """

    @property
    def constant(self) -> bool:
        """Whether w never changes."""
        return False

    @abstractmethod
    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w [-] and its total rate w' = ∂w/∂q·v + ∂w/∂t [1/s]."""

    def calls(self, time: Array) -> tuple[PartCalls, Array] | None:
        """Return the engine's calls that write w and w', and where they write them.

        The array has shape (2,); None: `sample` is called in every step.

        Args:
            time: The present time, shape (1,) [s].
        """
        del time
        return None


class ConstantWeight(Weight):
    """w = value, w' = 0."""

    value: NonNegative
    """w [-]."""

    @property
    def constant(self) -> bool:
        """True."""
        return True

    def calls(self, time: Array) -> tuple[PartCalls, Array]:
        """Return none, and w and 0; see `Weight.calls`."""
        del time
        return [], np.array([self.value, 0.0])

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and 0; see `Weight.sample`."""
        return self.value, 0.0


class Ramp(Weight):
    """w = a + (b - a)(10 s³ - 15 s⁴ + 6 s⁵), s = (t - start)/duration within [0, 1].

    A smooth change from one weight to another, C² in t.
    """

    _: KW_ONLY
    initial: NonNegative = 0.0
    """a, the weight before the ramp [-]."""
    final: NonNegative
    """b, the weight after the ramp [-]."""
    start: Number = 0.0
    """Time at which the ramp begins [s]."""
    duration: Positive
    """Duration of the ramp [s]."""

    def calls(self, time: Array) -> tuple[PartCalls, Array]:
        """Return the call that writes w and w'; see `Weight.calls`."""
        weight = np.zeros(2)
        call = PartCall(
            engine.RampWeight,
            initial=self.initial,
            final=self.final,
            start=self.start,
            duration=self.duration,
            time=time,
            weight=weight,
        )
        return [call], weight

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and w'; see `Weight.sample`."""
        s, s_dot, _ = engine.smooth_step(state.t, self.start, self.duration)
        rise = self.final - self.initial
        return self.initial + s * rise, s_dot * rise


class StateWeight(Weight):
    """w = function(state), with w' by differences along the flow."""

    function: Callable[[RobotState], float]
    """w of a state, ≥ 0 and continuously differentiable [-]; it may use q, t and
    frames, but not v."""

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and w'; see `Weight.sample`."""
        state = state.read_only
        value = float(self.function(state))
        if not 0.0 <= value < np.inf:
            raise FieldError(f"weight is {value}; must be at least 0")
        return value, float(rate_along_flow(self.function, state))


class SetWeight(Weight):
    """w and w' that are written elsewhere at run time, perhaps times a ramp."""

    numbers: InstanceOf[np.ndarray]
    """w [-] and w' [1/s], shape (2,), read in every step."""
    ramp: Ramp | None = None
    """A factor of w [-]; by default none."""

    def calls(self, time: Array) -> tuple[PartCalls, Array]:
        """Return the calls that write w and w' at a time, and where they write them."""
        if self.ramp is None:
            return [], self.numbers
        return _product(([], self.numbers), self.ramp.calls(time))

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and w'; see `Weight.sample`."""
        a, a_dot = self.numbers.tolist()
        if self.ramp is None:
            return a, a_dot
        b, b_dot = self.ramp.sample(state)
        return a * b, a_dot * b + a * b_dot


class Product(Weight):
    """w = a b, w' = a' b + a b': the product of two weights."""

    first: InstanceOf[Weight]
    """a [-]."""
    second: InstanceOf[Weight]
    """b [-]."""

    @property
    def constant(self) -> bool:
        """Whether neither factor changes."""
        return self.first.constant and self.second.constant

    def calls(self, time: Array) -> tuple[PartCalls, Array] | None:
        """Return those of both and of the product; see `Weight.calls`."""
        first, second = weight_calls(self.first, time), weight_calls(self.second, time)
        return None if first is None or second is None else _product(first, second)

    def sample(self, state: RobotState) -> tuple[float, float]:
        """Return w and w'; see `Weight.sample`."""
        (a, a_dot), (b, b_dot) = self.first.sample(state), self.second.sample(state)
        return a * b, a_dot * b + a * b_dot


def _product(
    first: tuple[PartCalls, Array], second: tuple[PartCalls, Array]
) -> tuple[PartCalls, Array]:
    """Return the calls of two weights and of their product."""
    (calls, a), (others, b), weight = first, second, np.zeros(2)
    times = PartCall(engine.ProductWeight, first=a, second=b, weight=weight)
    return [*calls, *others, times], weight


def weight_calls(weight: Weight | float, time: Array) -> tuple[PartCalls, Array] | None:
    """Return the result of `Weight.calls`; None: it is a number, or is in Python."""
    if not isinstance(weight, Weight):
        return None
    native = implemented_by(weight, "calls", "sample") == "calls"
    return weight.calls(time) if native else None


def sample_weight(weight: Weight | float, state: RobotState) -> tuple[float, float]:
    """Return w [-] and w' [1/s] of a weight or a number."""
    return weight.sample(state) if isinstance(weight, Weight) else (weight, 0.0)


def product(first: Weight | float, second: Weight | float) -> Weight | float:
    """Return the product of two weights; of numbers it is a number."""
    if isinstance(first, Weight) and isinstance(second, Weight):
        return Product(first, second)
    if not isinstance(first, Weight) and not isinstance(second, Weight):
        return float(first) * float(second)
    factor, weight = (second, first) if isinstance(first, Weight) else (first, second)
    assert isinstance(weight, Weight)
    assert not isinstance(factor, Weight)
    if factor == 1.0:
        return weight
    if isinstance(weight, Ramp):
        initial, final = weight.initial * factor, weight.final * factor
        return replace(weight, initial=initial, final=final)
    return Product(ConstantWeight(factor), weight)
