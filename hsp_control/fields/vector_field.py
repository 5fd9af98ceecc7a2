"""Fields given as vectors, among them a user's own Python function."""

from abc import abstractmethod
from collections.abc import Callable

import numpy as np

from hsp_control.arrays import Array
from hsp_control.differences import rate_along_flow
from hsp_control.exceptions import FieldError
from hsp_control.fields.field import FieldSample, NullSpaceField
from hsp_control.metrics import MetricSample
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
        for value, where, what in (
            (self.vector(state), out.g, "g"),
            (self.rate(state), out.g_dot, "g'"),
        ):
            array = np.asarray(value, dtype=float)
            if array.shape != where.shape or not np.isfinite(array).all():
                raise FieldError(
                    f"field {self.name!r} returned {what} = {value!r} at "
                    f"t = {state.t:.6g} s; needs {where.shape[0]} finite numbers"
                )
            where[:] = array
        return out

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
