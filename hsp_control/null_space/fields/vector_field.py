"""Fields given as vectors, among them a user's own Python function."""

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
    """A field given as it is: write `vector`, and `rate` if it has a closed form."""

    @abstractmethod
    def vector(self, state: RobotState) -> Array:
        """Return g(q, t), shape (nv,); it may not depend on the velocity."""

    def rate(self, state: RobotState) -> Array:
        """Return g' = ∂g/∂q·v + ∂g/∂t, by default by differences along the flow."""
        return rate_along_flow(self.vector, state)

    def evaluate(
        self, state: RobotState, metric: MetricSample, form: int, out: FieldSample
    ) -> FieldSample:
        """Write the vector and its rate.

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
        """Return ‖g‖."""
        return float(np.linalg.norm(self.vector(state)))


class FunctionField(VectorField):
    """A user's own vector field."""

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
            function: g of a state, shape (nv,); it reads q, t and frames, not v.
            rate: Its exact total rate of a state, if known.
            name: What the log calls it.
        """
        super().__init__(robot, name)
        self._function = function
        self._rate = rate

    def vector(self, state: RobotState) -> Array:
        """Return the function's value."""
        return self._function(state)

    def rate(self, state: RobotState) -> Array:
        """Return the given rate, or differences along the flow."""
        return super().rate(state) if self._rate is None else self._rate(state)
