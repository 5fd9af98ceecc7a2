"""The abstract null-space field, and weighted sums of fields."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import cached_property, partial
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.identity_cache import IdentityCache, without_caches
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.fields.weight import Product, Weight, as_weight
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import Robot, RobotState


class FieldSample(NamedTuple):
    """g and g' = ∂g/∂q·v + ∂g/∂t: a field at one state.

    Attributes:
        g: The field, a desired joint velocity, shape (nv,) [rad/s, m/s].
        g_dot: g', its total time derivative, shape (nv,) [rad/s², m/s²].
    """

    g: Array
    g_dot: Array

    @classmethod
    def allocate(cls, nv: int) -> "FieldSample":
        """Return a sample of zeros, shape (nv,) each."""
        return cls(np.zeros(nv), np.zeros(nv))


class NullSpaceField(ABC):
    """g(q, t): a desired joint velocity, of which the null space keeps P g.

    The null-space velocity converges exponentially to P g (Proposition 2). g is in the
    tangent space, shape (nv,) [rad/s, m/s]. Fields can be added and scaled:
    ``2.0 * centering + obstacle``.

    Most fields derive from `Cost` (g = -W⁻¹∇f) or from `VectorField` (g as given). A
    direct subclass calls ``super().__init__`` and implements two methods:

    * `evaluate` writes g and its exact total time derivative g'.
    * `value` returns one number to plot.

    It may override `compile` to make a step faster (by default the step plan calls
    `evaluate` at every step), and `minimum_distance` if the field measures distances.

    Attributes:
        robot: The robot.
        name: Name of the field in the log.
        controls: False only for `Uncontrolled`, which sets φ_N = 0.
    """

    controls: bool = True

    def __init__(self, robot: Robot, name: str) -> None:
        """Set the robot, and the name of the field in the log."""
        self.robot = robot
        self.name = name

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Reset `compile` if a subclass overrides `evaluate` only.

        Otherwise a subclass of a concrete field would inherit a step plan that ignores
        its `evaluate`.
        """
        super().__init_subclass__(**arguments)
        if "evaluate" in vars(cls) and "compile" not in vars(cls):
            cls.compile = NullSpaceField.compile  # type: ignore[method-assign]

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return the step plan that does what `evaluate` does; may be overridden.

        Args:
            state: The state that every step reads. Its values change between steps.
            metric: The metric's sample, written before the field's calls.
            form: The metric's form, see `Metric`.
            out: The sample that every step writes.
        """
        return StepPlan(write=(partial(self.evaluate, state, metric, form, out),))

    @abstractmethod
    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write g and g' = ∂g/∂q·v + ∂g/∂t into ``out``, and return ``out``.

        Args:
            state: The robot's state: t, q, v and the kinematics.
            metric: The joint-space metric at this state.
            form: The metric's form, see `Metric`.
            out: The sample to write into, shape (nv,) each.
        """

    @abstractmethod
    def value(self, state: RobotState) -> float:
        """Return one number to plot: f(q, t) of a cost, or the norm of a field."""

    def minimum_distance(self, state: RobotState) -> float | None:
        """Return the minimum distance that the field measures [m], or None."""
        return None

    def __add__(self, other: "NullSpaceField") -> "WeightedSum":
        if not isinstance(other, NullSpaceField):
            return NotImplemented
        return WeightedSum([(1.0, self), (1.0, other)])

    def __rmul__(self, weight: Weight | float) -> "WeightedSum":
        if not isinstance(weight, Real | Weight):
            return NotImplemented
        return WeightedSum([(weight, self)])


class WeightedSum(NullSpaceField):
    """g = Σ w_k g_k, g' = Σ (w_k g_k' + w_k' g_k); a sum of sums is flattened.

    Attributes:
        terms: The (weight, field) pairs.
        samples: The weighted sample of each term at the last step.
    """

    def __init__(self, terms: Sequence[tuple[Weight | float, NullSpaceField]]) -> None:
        """Add fields of one robot.

        Args:
            terms: (weight, field) pairs; a weight is a number ≥ 0 or a `Weight`.

        Raises:
            FieldError: If there is no term, a weight is negative or not finite, a term
                is `Uncontrolled`, or the fields belong to different robots.
        """
        if not terms:
            raise FieldError("a sum of fields needs at least one term")
        flat: list[tuple[Weight, NullSpaceField]] = []
        for weight, field in terms:
            try:
                flat.extend(_flatten(as_weight(weight), field))
            except FieldError as error:
                raise FieldError(f"field {field.name!r}: {error}") from error
        robot = flat[0][1].robot
        if not all(field.controls for _, field in flat):
            raise FieldError("an uncontrolled null space cannot be part of a sum")
        if any(field.robot is not robot for _, field in flat):
            raise FieldError("the fields of a sum belong to different robots")
        super().__init__(robot, " + ".join(field.name for _, field in flat))
        self.terms: tuple[tuple[Weight, NullSpaceField], ...] = tuple(flat)
        self.samples = tuple(FieldSample.allocate(robot.nv) for _ in flat)

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write the weighted sums of g and g'; see `NullSpaceField.evaluate`."""
        for weight, field, sample, weights, add in self._compiled.get(out):
            field.evaluate(state, metric, form, sample)
            weights[:] = weight.sample(state)
            add()
        return out

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return the step plan; see `NullSpaceField.compile`."""
        follow: list[Callable[[float], object]] = []
        write: list[Callable[[], object]] = []
        for weight, field, sample, weights, add in self._compile(out):
            term = field.compile(state, metric, form, sample)
            follow += term.follow
            write += term.write
            if weight.constant:
                weights[:] = weight.sample(state)
            else:
                write.append(partial(_update, weight, state, weights))
            write.append(add)
        return StepPlan(tuple(follow), tuple(write))

    def _compile(self, out: FieldSample) -> "list[_Term]":
        terms = []
        for k, ((weight, field), sample) in enumerate(
            zip(self.terms, self.samples, strict=True)
        ):
            weights = np.zeros(2)
            add = bind(_add, k == 0, weights, *sample, *out)
            terms.append((weight, field, sample, weights, add))
        return terms

    @cached_property
    def _compiled(self) -> "IdentityCache[list[_Term]]":
        return IdentityCache(self._compile)

    def __getstate__(self) -> dict[str, Any]:
        return without_caches(self)

    def value(self, state: RobotState) -> float:
        """Return Σ w_k value_k."""
        return sum(
            weight.sample(state)[0] * field.value(state) for weight, field in self.terms
        )


_Term = tuple[Weight, NullSpaceField, FieldSample, Array, Callable[[], object]]
"""A weight, its field, the field's sample, (w, w'), and a call that adds to the sum."""


def _update(weight: Weight, state: RobotState, weights: Array) -> None:
    weights[:] = weight.sample(state)


@kernel
def _add(
    first: bool,
    weights: Array,
    g: Array,
    g_dot: Array,
    sum_g: Array,
    sum_g_dot: Array,
) -> None:
    """Scale a sample by w and w', and add it to the sum; ``first`` starts the sum."""
    w, w_dot = weights[0], weights[1]
    for i in range(g.shape[0]):
        g_dot[i] = w * g_dot[i] + w_dot * g[i]
        g[i] *= w
        sum_g[i] = g[i] if first else sum_g[i] + g[i]
        sum_g_dot[i] = g_dot[i] if first else sum_g_dot[i] + g_dot[i]


def _flatten(
    weight: Weight, field: NullSpaceField
) -> list[tuple[Weight, NullSpaceField]]:
    if not isinstance(field, WeightedSum):
        return [(weight, field)]
    return [(Product(weight, inner), term) for inner, term in field.terms]
