"""The abstract null-space field, and weighted sums of fields."""

import re
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from numbers import Real
from typing import Annotated, Any, ClassVar, Self

import numpy as np
from pydantic import AfterValidator, InstanceOf

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import FieldError
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import NonNegative, OrInstance
from hsp_control.engine.plans import AnyCall, PartCall, PartCalls, implemented_by
from hsp_control.geometry.scene import Start
from hsp_control.law import FieldSample, MetricSample
from hsp_control.law.samples import check_sample
from hsp_control.null_space.fields.weight import (
    Ramp,
    Weight,
    product,
    sample_weight,
    weight_calls,
)
from hsp_control.robot import RobotState


class NullSpaceField(Part, ABC, family="fields", error=FieldError):
    """g(q, t): a desired joint velocity, whose projection P g the null space follows.

    The null-space velocity converges exponentially to P g (Proposition 2). g is in the
    tangent space, shape (nv,) [rad/s, m/s]. Fields can be added and scaled:
    ``2.0 * centering + obstacle``.

    Most fields derive from `Cost` (g = -W⁻¹∇f) or from `VectorField` (g as given). A
    direct subclass declares its parameters as fields (see `Part`) and implements two
    methods:

    * `evaluate` writes g and its exact total time derivative g'.
    * `value` returns one number to plot.

    It may override `placed` if it refers to the start, to obstacles or to frames, and
    `minimum_distance` if it measures distances. A field has no memory: the state stores
    the buffers of a computation (see `RobotState.cached`).

    All methods are about the field without its weight. The sum applies the weight.

    Attributes:
        controls: False only for `Uncontrolled`, which sets φ_N = 0.
        zero: Whether g = 0 at all times.
    """

    controls: ClassVar[bool] = True
    zero: ClassVar[bool] = False

    _: KW_ONLY
    weight: Annotated[float | Weight, OrInstance(NonNegative | Ramp, Weight)] = 1.0
    """Weight of the field in the sum [-]: a number, or a ramp in time."""
    name: str = ""
    """Name of the field in the log [-]; its type by default."""

    def _complete(self) -> None:
        if not self.name:
            self._set_default("name", self._default_name())

    def _default_name(self) -> str:
        words = re.sub("(?<=[a-z0-9])(?=[A-Z])", "_", type(self).__name__).lower()
        return self.yaml_type or words

    def changed_fields(self) -> dict[str, Any]:
        """Return the fields that are not their defaults, by name."""
        changed = super().changed_fields()
        if self.name == self._default_name():
            changed.pop("name", None)
        return changed

    def placed(self, start: Start) -> Self:
        """Return the field for a robot and a start, checked.

        Values that are relative to the start, and omitted ones that the robot defines,
        are replaced by numbers and names; by default there are none.

        Raises:
            HspControlError: If the field does not fit the robot or the scene.
        """
        return self

    def _not_placed(self, what: str) -> FieldError:
        """Return the error of a field that is used before it is placed."""
        return FieldError(
            f"field {self.name!r}: a controller would look up its {what}; outside of "
            "one, call `placed` first"
        )

    def calls(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> PartCalls:
        """Return the calls that write the sample in a step.

        Args:
            state: The state that every step reads. Its values change between steps.
            metric: The metric's sample, written before the field's calls.
            form: The metric's form, see `Metric`.
            out: The sample that every step writes.
        """
        if implemented_by(self, "own_calls", "evaluate") == "own_calls":
            return self.own_calls(state, metric, form, out)
        if self.zero:
            self.evaluate(state.read_only, metric, form, out)
            return []
        call = PartCall(
            self.evaluate, state=state.read_only, metric=metric, form=form, out=out
        )
        return [call]

    def own_calls(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> PartCalls:
        """Return the calls of a field of the engine; otherwise see `evaluate`."""
        raise TypeError(f"{type(self).__name__} implements no evaluate")

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write g and g' = ∂g/∂q·v + ∂g/∂t into ``out``, and return ``out``.

        Args:
            state: The robot's state: t, q, v and the kinematics.
            metric: The joint-space metric at this state.
            form: The metric's form, see `Metric`.
            out: The sample to write into, shapes (nv,).
        """
        check_sample("metric", metric, MetricSample, state.robot.nv)
        check_sample("out", out, FieldSample, state.robot.nv)

        def make() -> tuple[tuple[MetricSample, FieldSample], PartCalls]:
            known = MetricSample.allocate(state.robot.nv)
            sample = FieldSample.allocate(state.robot.nv)
            return (known, sample), self.own_calls(state, known, form, sample)

        (known, sample), run = state.prepared(self, f"evaluate {form}", make)
        for array, value in zip(known, metric, strict=True):
            array[:] = value
        run()
        for array, value in zip(out, sample, strict=True):
            array[:] = value
        return out

    @abstractmethod
    def value(self, state: RobotState) -> float:
        """Return one number to plot: f(q, t) of a cost, or the norm of a field."""

    def minimum_distance(self, state: RobotState) -> float | None:
        """Return the minimum distance that the field measures [m], or None."""
        return None

    def __add__(self, other: "NullSpaceField") -> "FieldSum":
        if not isinstance(other, NullSpaceField):
            return NotImplemented
        return FieldSum((*terms_of(self), *terms_of(other)))

    def __rmul__(self, factor: Weight | float) -> Self:
        if not isinstance(factor, Real | Weight):
            return NotImplemented
        return replace(self, weight=product(factor, self.weight))


class FieldSum(NullSpaceField):
    """g = Σ w_k g_k, g' = Σ (w_k g_k' + w_k' g_k).

    A sum of sums is flattened, and a weight of the sum goes to its terms.
    """

    terms: Annotated[Sequence[InstanceOf[NullSpaceField]], AfterValidator(tuple)]
    """The fields, with their weights [-]."""
    _: KW_ONLY
    name: str = ""
    """Name of the field in the log [-]; the names of its terms by default."""

    def __post_init__(self) -> None:
        """Check the terms."""
        if not self.terms:
            raise FieldError("a sum of fields needs at least one term")
        if not all(term.controls for term in self.terms):
            raise FieldError("an uncontrolled null space cannot be part of a sum")

    def _complete(self) -> None:
        terms = tuple(flat for term in self.terms for flat in terms_of(term))
        if self.weight != 1.0:
            terms = tuple(self.weight * term for term in terms)
        self._set_default("terms", terms)
        self._set_default("weight", 1.0)
        super()._complete()

    def _default_name(self) -> str:
        return " + ".join(term.name for term in self.terms)

    def placed(self, start: Start) -> Self:
        """Return the sum of the placed fields; see `NullSpaceField.placed`."""
        placed = []
        for k, term in enumerate(self.terms):
            with within(k):
                placed.append(term.placed(start))
        return replace(self, terms=tuple(placed))

    def own_calls(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> PartCalls:
        """Return the calls of all terms."""
        return self.calls_of_terms(
            state, metric, form, out, self.allocate_terms(state.robot.nv)
        )

    def allocate_terms(self, nv: int) -> tuple[FieldSample, ...]:
        """Return a sample of zeros for every term."""
        return tuple(FieldSample.allocate(nv) for _ in self.terms)

    def calls_of_terms(
        self,
        state: RobotState,
        metric: MetricSample,
        form: int,
        out: FieldSample,
        samples: Sequence[FieldSample],
    ) -> PartCalls:
        """Return the calls, which also write the weighted sample of each term."""
        calls: list[AnyCall] = []
        for k, (term, sample) in enumerate(zip(self.terms, samples, strict=True)):
            calls += term.calls(state, metric, form, sample)
            own = term.weight
            evaluated = weight_calls(own, state.time)
            weights = np.zeros(2) if evaluated is None else evaluated[1]
            if evaluated is not None:
                calls += evaluated[0]
            elif isinstance(own, Weight) and not own.constant:
                seen = state.read_only
                update = PartCall(_update, weight=own, state=seen, weights=weights)
                calls.append(update)
            else:
                weights[:] = sample_weight(own, state)
            add = PartCall(
                engine.AddWeighted, first=k == 0, weight=weights, term=sample, sum=out
            )
            calls.append(add)
        return calls

    def value(self, state: RobotState) -> float:
        """Return Σ w_k value_k."""
        return sum(
            sample_weight(term.weight, state)[0] * term.value(state)
            for term in self.terms
        )


def terms_of(field: NullSpaceField) -> tuple[NullSpaceField, ...]:
    """Return the terms of a sum, or the field itself as the only one."""
    return tuple(field.terms) if isinstance(field, FieldSum) else (field,)


def _update(weight: Weight, state: RobotState, weights: Array) -> None:
    weights[:] = weight.sample(state)
