"""What a null-space field is: a joint velocity g(q, t) for self-motion to reach."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from functools import partial
from numbers import Real
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.null_space.fields.weight import Product, Weight, as_weight
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import Robot, RobotState


class FieldSample(NamedTuple):
    """A field at one state.

    Attributes:
        g: The field, shape (nv,) [rad/s, m/s].
        g_dot: Its total time derivative ∂g/∂q·v + ∂g/∂t, shape (nv,).
    """

    g: Array
    g_dot: Array

    @classmethod
    def allocate(cls, nv: int) -> "FieldSample":
        """Return a sample of zeros."""
        return cls(np.zeros(nv), np.zeros(nv))


class NullSpaceField(ABC):
    """A vector field g(q, t) on the configuration space, in tangent coordinates.

    The null-space velocity converges to its projection P g (Proposition 2). Two kinds
    exist: a `Cost`, whose field is -W⁻¹∇f, and a `VectorField`, given as it is.
    Fields add and scale: ``2.0 * centering + obstacle``.

    Attributes:
        robot: The robot.
        name: What the log calls it.
        controls: False for φ_N = 0, which leaves self-motion alone; see `Uncontrolled`.
    """

    controls: bool = True

    def __init__(self, robot: Robot, name: str) -> None:
        """Keep the robot and the name."""
        self.robot = robot
        self.name = name

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Let an `evaluate` that is overridden count, also of a ready field."""
        super().__init_subclass__(**arguments)
        if "evaluate" in vars(cls) and "compile" not in vars(cls):
            cls.compile = NullSpaceField.compile  # type: ignore[method-assign]

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return what `evaluate` does with this state and these samples."""
        return StepPlan(write=(partial(self.evaluate, state, metric, form, out),))

    @abstractmethod
    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write g and its exact total rate into ``out`` and return it.

        Args:
            state: The robot's state.
            metric: The joint-space metric there.
            form: The metric's form, see `hsp_control.null_space.metrics`.
            out: Where to write.
        """

    @abstractmethod
    def value(self, state: RobotState) -> float:
        """Return the number to plot: a cost's value f(q, t), or a field's norm."""

    def least_distance(self, state: RobotState) -> float | None:
        """Return the least distance that the field watches [m], if it watches any."""
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
        samples: What each term contributed at the last `evaluate`, weighted.
    """

    def __init__(self, terms: Sequence[tuple[Weight | float, NullSpaceField]]) -> None:
        """Add fields of one robot.

        Raises:
            FieldError: If there is no term, a weight is negative or not finite, or the
                fields belong to different robots.
        """
        if not terms:
            raise FieldError("a sum of fields needs at least one term")
        flat: list[tuple[Weight, NullSpaceField]] = []
        for weight, field in terms:
            try:
                flat.extend(_flattened(as_weight(weight), field))
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
        self._bound: tuple[FieldSample, list[_Term]] | None = None

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write the weighted sums of g and g'."""
        bound = self._bound
        if bound is None or bound[0] is not out:
            self._bound = bound = out, self._compile(out)
        for weight, field, sample, weigh, add in bound[1]:
            field.evaluate(state, metric, form, sample)
            weigh[:] = weight.sample(state)
            add()
        return out

    def compile(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> StepPlan:
        """Return what `evaluate` does; see `NullSpaceField.bind`."""
        follow: list[Callable[[float], object]] = []
        write: list[Callable[[], object]] = []
        for weight, field, sample, weigh, add in self._compile(out):
            term = field.compile(state, metric, form, sample)
            follow += term.follow
            write += term.write
            if weight.constant:
                weigh[:] = weight.sample(state)
            else:
                write.append(partial(_weigh, weight, state, weigh))
            write.append(add)
        return StepPlan(tuple(follow), tuple(write))

    def _compile(self, out: FieldSample) -> "list[_Term]":
        terms = []
        for k, ((weight, field), sample) in enumerate(
            zip(self.terms, self.samples, strict=True)
        ):
            weigh = np.zeros(2)
            add = bind(_add, k == 0, weigh, *sample, *out)
            terms.append((weight, field, sample, weigh, add))
        return terms

    def __getstate__(self) -> dict[str, Any]:
        """Return all but what is bound to another's memory."""
        return self.__dict__ | {"_bound": None}

    def value(self, state: RobotState) -> float:
        """Return the weighted sum of the terms' values."""
        return sum(
            weight.sample(state)[0] * field.value(state) for weight, field in self.terms
        )


_Term = tuple[Weight, NullSpaceField, FieldSample, Array, Callable[[], object]]
"""A weight, its field and what it writes; w and w', and what then adds to the sum."""


def _weigh(weight: Weight, state: RobotState, weigh: Array) -> None:
    weigh[:] = weight.sample(state)


@kernel
def _add(
    first: bool,
    weigh: Array,
    g: Array,
    g_dot: Array,
    sum_g: Array,
    sum_g_dot: Array,
) -> None:
    """Weight a sample by w and w', and add it to the sum, begun by the first one."""
    w, w_dot = weigh[0], weigh[1]
    for i in range(g.shape[0]):
        g_dot[i] = w * g_dot[i] + w_dot * g[i]
        g[i] *= w
        sum_g[i] = g[i] if first else sum_g[i] + g[i]
        sum_g_dot[i] = g_dot[i] if first else sum_g_dot[i] + g_dot[i]


def _flattened(
    weight: Weight, field: NullSpaceField
) -> list[tuple[Weight, NullSpaceField]]:
    if not isinstance(field, WeightedSum):
        return [(weight, field)]
    return [(Product(weight, inner), term) for inner, term in field.terms]
