"""Fields that are not gradients: given by a function, rest, or none."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import KW_ONLY
from typing import Annotated, ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import FieldError
from hsp_control.declaration.imported import AS_TEXT, NAMED
from hsp_control.law import FieldSample, MetricSample
from hsp_control.law.samples import check_sample
from hsp_control.null_space.fields.field import NullSpaceField
from hsp_control.robot import RobotState
from hsp_control.robot.differences import rate_along_flow


class VectorField(NullSpaceField):
    """g(q, t) = vector(state): a field that does not depend on a metric.

    A subclass declares its parameters as fields (see `Part`) and implements `vector`.
    It may override `rate`, which by default uses differences along the flow (error
    about 1e-9), and `value`.
    """

    @abstractmethod
    def vector(self, state: RobotState) -> Array:
        """Return g(q, t), shape (nv,) [rad/s, m/s], which must not depend on v."""

    def rate(self, state: RobotState) -> Array:
        """Return g' = ∂g/∂q·v + ∂g/∂t, shape (nv,); by default by differences."""
        return rate_along_flow(self.vector, state)

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write g and g'; see `NullSpaceField.evaluate`.

        Raises:
            FieldError: If either is not an array of nv finite numbers.
        """
        check_sample("out", out, FieldSample, state.robot.nv)
        out.g[:] = self._tangent(self.vector(state), "g", state)
        out.g_dot[:] = self._tangent(self.rate(state), "g'", state)
        return out

    def _tangent(self, value: Array, what: str, state: RobotState) -> Array:
        nv = state.robot.nv
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != (nv,) or not np.isfinite(array).all():
            raise FieldError(
                f"field {self.name!r} returned {what} = {value!r} at t = "
                f"{state.t:.6g} s; needs {nv} finite numbers"
            )
        return array

    def value(self, state: RobotState) -> float:
        """Return ‖g‖, the Euclidean norm."""
        return float(np.linalg.norm(self.vector(state)))


class FunctionField(VectorField, type="function_field"):
    """g = function(state): a vector field given as a Python function.

    YAML gives the function's name; see `FunctionCost`.
    """

    function: Annotated[Callable[[RobotState], Array], NAMED, AS_TEXT]
    """g of a state, shape (nv,) [rad/s, m/s]; it may use q, t and frames, but not v."""
    _: KW_ONLY
    rate_function: Annotated[Callable[[RobotState], Array], NAMED, AS_TEXT] | None = (
        None
    )
    """g' = ∂g/∂q·v + ∂g/∂t of a state, shape (nv,) [rad/s², m/s²]; by differences by
    default."""

    def vector(self, state: RobotState) -> Array:
        """Return g."""
        return self.function(state.read_only)

    def rate(self, state: RobotState) -> Array:
        """Return g' from the given function, or by differences along the flow."""
        if self.rate_function is None:
            return super().rate(state)
        return self.rate_function(state.read_only)


class Rest(NullSpaceField, type="rest"):
    """g = 0: self-motion comes to rest. The paper's second simulation."""

    zero: ClassVar[bool] = True

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write g = 0 and g' = 0; see `NullSpaceField.evaluate`."""
        check_sample("out", out, FieldSample, state.robot.nv)
        out.g[:] = 0.0
        out.g_dot[:] = 0.0
        return out

    def value(self, state: RobotState) -> float:
        """Return 0."""
        return 0.0


class Uncontrolled(Rest, type="uncontrolled"):
    """φ_N = 0: self-motion is not controlled. The paper's first simulation.

    Only for demonstration. The task is tracked, but the self-motion is undamped, and
    the joints drift away without any task error. It has no weight, and cannot be added
    to other fields.
    """

    controls: ClassVar[bool] = False

    def __post_init__(self) -> None:
        """Check that it has no weight."""
        if self.weight != 1.0:
            raise FieldError("an uncontrolled null space has no weight")
