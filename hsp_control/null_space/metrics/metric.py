"""Joint-space metrics W(q): the abstract one, the mass matrix, and constant ones."""

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, replace
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import MetricError
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import (
    ArrayField,
    Matrix,
    Number,
    Positive,
    numbers,
    read_only,
)
from hsp_control.engine.plans import PartCall, PartCalls, implemented_by
from hsp_control.geometry.scene import Start
from hsp_control.law import CONSTANT, IDENTITY, VARYING, MetricSample
from hsp_control.law.samples import check_sample
from hsp_control.robot import RobotState


class Metric(Part, ABC, family="metrics", error=MetricError):
    """‖v‖²_W = vᵀ W(q) v: a joint-space metric, W symmetric positive definite.

    The law minimises joint motion in this norm: the pseudo-inverse is
    J# = W⁻¹Jᵀ(JW⁻¹Jᵀ)⁻¹, the null-space projector P = I - J#J, and the field of a cost
    -W⁻¹∇f. W acts on the tangent space: v has shape (nv,) and is in rad/s and m/s.

    A subclass declares its parameters as fields (see `Part`), sets `form` to CONSTANT
    or VARYING and implements `evaluate`, or `call`, which makes a step faster; if W
    is constant, derive from `FixedMetric` instead. It may override `placed`. A metric
    has no memory: the state stores the buffers of a computation (see
    `RobotState.cached`).

    Attributes:
        form: IDENTITY, CONSTANT or VARYING; the law skips terms that are zero.
    """

    form: ClassVar[int]

    def placed(self, start: Start) -> Self:
        """Return the metric for a robot and a start, checked.

        Omitted values that the robot defines are replaced by numbers. By default there
        are none, and every robot fits.

        Raises:
            MetricError: If the metric does not fit the robot.
        """
        return self

    def call(self, state: RobotState) -> PartCall:
        """Return a kind of call with its arguments, without ``out``.

        With it, a `MetricSample`, it writes the result of `evaluate`; see `Task.call`
        for its arguments.
        """
        raise TypeError(f"{type(self).__name__} implements neither call nor evaluate")

    def calls(self, state: RobotState, out: MetricSample) -> PartCalls:
        """Return the calls that write the sample in a step."""
        if self.form != VARYING:
            self.evaluate(state.read_only, out)
            return []
        if implemented_by(self, "call", "evaluate") == "call":
            return [self.call(state).given(out=out)]
        return [PartCall(self.evaluate, state=state.read_only, out=out)]

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W = L Lᵀ and W' at a state into ``out`` and return ``out``.

        ``out`` is the identity with W' = 0 before the first call; entries that never
        change from that need not be written.

        Args:
            state: The robot's state: t, q, v and the kinematics.
            out: The sample to write into, shapes (nv, nv).
        """
        check_sample("out", out, MetricSample, state.robot.nv)
        state.run([self.call(state).given(out=out)])
        return out


class MassMatrixMetric(Metric, type="mass_matrix"):
    """W = M(q)/m, W' = (C + Cᵀ)/m: the kinetic energy is ½ m vᵀWv.

    Null-space efforts do not accelerate the task (dynamically consistent). M is badly
    conditioned on real robots (condition number 4e2 on a Panda, 1e5 on a humanoid):
    light joints, such as wrists, then do most of the task's motion.
    """

    _: KW_ONLY
    inertia: Positive | Literal["robot"] = 1.0
    """m [kg·m²]: J# and the projector do not depend on it; joints of this inertia
    descend a cost as fast as with the identity, lighter ones faster. ``robot``: the
    geometric mean of its joints' inertias."""

    form: ClassVar[int] = VARYING

    def placed(self, start: Start) -> Self:
        """Return the metric with the robot's own inertia in numbers."""
        if self.inertia != "robot":
            return self
        return replace(self, inertia=start.state.robot.typical_inertia)

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Metric.call`."""
        known = self.inertia != "robot"
        unit = self.inertia if known else state.robot.typical_inertia
        return PartCall(
            engine.MassMatrixMetric,
            M=state.inertia,
            M_dot=state.inertia_rate,
            inertia=unit,
        )

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W = M/m, L and W' = M'/m; see `Metric.evaluate`."""
        super().evaluate(state, out)
        if np.isnan(out.L[0, 0]):
            raise MetricError(f"the mass matrix is singular at q = {state.q.tolist()}")
        return out


class FixedMetric(Metric):
    """W = const, symmetric positive definite.

    A subclass has a field ``matrix``, and implements `_matrix`.
    """

    form: ClassVar[int] = CONSTANT

    @abstractmethod
    def _matrix(self) -> Array:
        """Return W, shape (nv, nv); `W` checks it."""

    @cached_property
    def W(self) -> Array:
        """The matrix, read-only, shape (nv, nv)."""
        matrix = self._matrix()
        if matrix.ndim != 2 or matrix.shape[0] != matrix.shape[1]:
            raise MetricError(f"the metric has shape {matrix.shape}; needs (nv, nv)")
        if not np.isfinite(matrix).all():
            raise MetricError("the metric contains NaN or inf")
        if np.abs(matrix - matrix.T).max() > 1e-12 * np.abs(matrix).max():
            raise MetricError("the metric is not symmetric")
        values = np.linalg.eigvalsh(matrix)
        if values[0] <= 1e-12 * values[-1]:  # a zero may be computed as about 1e-16
            raise MetricError(
                "the metric is not positive definite: its smallest eigenvalue is "
                f"{values[0]:.3g}, its largest {values[-1]:.3g}"
            )
        matrix.setflags(write=False)
        return matrix

    @cached_property
    def _factor(self) -> Array:
        """L with W = L Lᵀ, shape (nv, nv)."""
        return np.asarray(np.linalg.cholesky(self.W))

    def placed(self, start: Start) -> Self:
        """Return the metric, checked; see `Metric.placed`."""
        nv, shape = start.state.robot.nv, self.W.shape
        with within("matrix"):
            if shape[0] != nv:
                raise MetricError(
                    f"the metric has shape {shape}; the robot needs ({nv}, {nv})"
                )
        return self

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W and L; W' stays zero. See `Metric.evaluate`."""
        check_sample("out", out, MetricSample, state.robot.nv)
        out.W[:] = self.W
        out.L[:] = self._factor
        return out


class IdentityMetric(Metric, type="identity"):
    """W = I: the motions of all joints are weighted equally. The default."""

    form: ClassVar[int] = IDENTITY

    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Return ``out`` unchanged: `MetricSample.allocate` returns the identity."""
        check_sample("out", out, MetricSample, state.robot.nv)
        return out


_Row = Annotated[list[Number], Field(min_length=1)]


def _array(value: list[Any]) -> Array:
    """Return the matrix or its diagonal, read-only."""
    if len({isinstance(entry, list) for entry in value}) > 1:
        raise ValueError("mixes numbers and rows; needs rows, or numbers (a diagonal)")
    return read_only(value)


_Entries = Annotated[list[Number | _Row], Field(min_length=1)]


class ConstantMetric(FixedMetric, type="constant"):
    """W = const, symmetric positive definite: weighted joints."""

    matrix: Annotated[ArrayLike, ArrayField(_Entries, _array)]
    """W, shape (nv, nv), or its diagonal, shape (nv,) [-]."""

    @classmethod
    def of_value(cls, value: object) -> Self | None:
        """Return the metric of a matrix, or of its diagonal."""
        matrix = numbers(value)
        return None if matrix is None else cls(matrix)

    def __post_init__(self) -> None:
        """Check the matrix."""
        self.W  # noqa: B018 (computed, checked and kept)

    def _matrix(self) -> Array:
        matrix = np.array(self.matrix)
        return np.diag(matrix) if matrix.ndim == 1 else matrix


class CoordinatesMetric(FixedMetric, type="coordinates"):
    """W = AᵀA, Euclidean in the joint coordinates θ = A q.

    The law then equals the paper's law in these coordinates, because a pseudo-inverse
    changes with the coordinates (docs/law.md).
    """

    matrix: Matrix | None = None
    """A, invertible, shape (nv, nv) [-]; by default that of the robot's source."""

    def __post_init__(self) -> None:
        """Check the matrix."""
        if self.matrix is not None:
            self.W  # noqa: B018 (computed, checked and kept)

    def placed(self, start: Start) -> Self:
        """Return the metric with A as a matrix, checked; see `Metric.placed`."""
        if self.matrix is not None:
            return super().placed(start)
        A = start.state.robot.joint_coordinates
        if A is None:
            raise MetricError(
                f"{start.state.robot.name} defines no joint coordinates; give matrix"
            )
        return replace(self, matrix=A)

    def _matrix(self) -> Array:
        if self.matrix is None:
            raise MetricError("the robot knows these coordinates: place the metric")
        A = np.asarray(self.matrix)
        if A.shape[0] != A.shape[1]:
            raise MetricError(f"the coordinates have shape {A.shape}; need (nv, nv)")
        return np.asarray(A.T @ A)
