"""The abstract vector field g(q, t), and vector fields given as functions."""

from abc import abstractmethod
from collections.abc import Callable

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.null_space.differences import rate_along_flow
from hsp_control.null_space.fields.field import FieldSample, NullSpaceField
from hsp_control.null_space.metrics import MetricSample
from hsp_control.robot import Robot, RobotState


class VectorField(NullSpaceField):
    """g(q, t) = vector(state): a field that does not depend on a metric.

    A subclass calls ``super().__init__(robot, name)`` and implements `vector`. It may
    override `rate`, which by default uses differences along the flow (error about
    1e-9), and `value`.
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
        out.g[:] = self._tangent(self.vector(state), "g", state.t)
        out.g_dot[:] = self._tangent(self.rate(state), "g'", state.t)
        return out

    def _tangent(self, value: Array, what: str, t: float) -> Array:
        nv = self.robot.nv
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            array = np.empty(0)
        if array.shape != (nv,) or not np.isfinite(array).all():
            raise FieldError(
                f"field {self.name!r} returned {what} = {value!r} at t = {t:.6g} s; "
                f"needs {nv} finite numbers"
            )
        return array

    def value(self, state: RobotState) -> float:
        """Return ‖g‖, the Euclidean norm."""
        return float(np.linalg.norm(self.vector(state)))


class FunctionField(VectorField):
    """g = function(state): a vector field given as a Python function."""

    def __init__(
        self,
        robot: Robot,
        function: Callable[[RobotState], Array],
        *,
        rate: Callable[[RobotState], Array] | None = None,
        name: str = "function",
    ) -> None:
        """Set the field.

        Args:
            robot: The robot.
            function: g of a state, shape (nv,) [rad/s, m/s]; it may use q, t and
                frames, but not v.
            rate: g' = ∂g/∂q·v + ∂g/∂t of a state, shape (nv,); None: by differences.
            name: Name of the field in the log.
        """
        super().__init__(robot, name)
        self._function = function
        self._rate = rate

    def vector(self, state: RobotState) -> Array:
        """Return g."""
        return self._function(state)

    def rate(self, state: RobotState) -> Array:
        """Return g' from the given function, or by differences along the flow."""
        return super().rate(state) if self._rate is None else self._rate(state)
