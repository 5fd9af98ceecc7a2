"""A task whose value is a Python function of the state."""

from collections.abc import Callable
from dataclasses import KW_ONLY, replace
from typing import Annotated, Any, Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import TaskError
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.imported import AS_TEXT, NAMED
from hsp_control.declaration.quantities import PositiveCount
from hsp_control.geometry.scene import Start
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState
from hsp_control.robot.differences import gradient, rate_along_flow
from hsp_control.tasks.feedback import ErrorPart, Feedback
from hsp_control.tasks.frame_task import TrackingTask, place_point
from hsp_control.trajectories import Hold, Trajectory

StateFunction = Annotated[Callable[[RobotState], Array], NAMED, AS_TEXT]


class FunctionTask(TrackingTask, type="function_task"):
    """e = x_d - y(q, t): m numbers, computed by a Python function, follow a trajectory.

    With the rates along the motion, y' = J v + ∂y/∂t and y'' = J a + J'v + (∂y/∂t)',
    the error equation e'' + Kv e' + Kp e = 0 is J a + J'v = a_x with
    a_x = x_d'' - (∂y/∂t)' + Kv e' + Kp e + offset.

    Omitted derivatives are computed by fourth-order differences; that of J' has an
    error of about 1e-9 and needs 16 nv evaluations of the function. YAML gives the
    names of functions; see `FunctionCost`.
    """

    function: StateFunction
    """y of a state, m numbers or one [in `unit`]; it may use q, t and frames, but not
    v, and must be twice differentiable."""
    trajectory: Given[Trajectory, ArrayLike] = default(Hold())
    """x_d(t), the trajectory of y [in `unit`]; held at the start by default."""
    _: KW_ONLY
    size: PositiveCount = 1
    """Number of rows m [-]."""
    unit: str = "-"
    """Unit of y [-]; with ``m`` or ``rad`` the largest error is that of a position or
    of an orientation."""
    jacobian_function: StateFunction | None = None
    """J = ∂y/∂q of a state in the tangent space, shape (m, nv); by differences by
    default."""
    jacobian_rate_function: StateFunction | None = None
    """J' of a state along its motion, shape (m, nv); by differences by default."""
    rate_function: StateFunction | None = None
    """y' = J v + ∂y/∂t of a state, shape (m,); by differences by default."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The numbers of y."""
        return (ErrorPart("value", self.unit, f"{self.unit}/s", self.size),)

    @property
    def followed(self) -> Trajectory:
        """The trajectory of y."""
        return self.trajectory

    def placed(self, start: Start) -> Self:
        """Return the task with its trajectory in numbers; see `Task.placed`."""
        here = self.value(start.state)
        trajectory = place_point(self.trajectory, here, self.blend)
        placed = replace(self, trajectory=trajectory, blend=None)
        return placed.checked(start.state.robot)

    # --- y and its derivatives --------------------------------------------------------

    def value(self, state: RobotState) -> Array:
        """Return y, shape (m,).

        Raises:
            TaskError: If the function does not return m finite numbers.
        """
        return self._numbers(self.function(state.read_only), "function", self.size)

    def rate(self, state: RobotState) -> Array:
        """Return y' along the motion of the state, shape (m,)."""
        if self.rate_function is None:
            return rate_along_flow(self.value, state)
        found = self.rate_function(state.read_only)
        return self._numbers(found, "rate_function", self.size)

    def jacobian(self, state: RobotState) -> Array:
        """Return J, shape (m, nv)."""
        if self.jacobian_function is None:
            return gradient(self.value, state)
        found = self.jacobian_function(state.read_only)
        return self._matrix(found, "jacobian_function", state)

    def jacobian_rate(self, state: RobotState) -> Array:
        """Return J' along the motion of the state, shape (m, nv)."""
        if self.jacobian_rate_function is None:
            return rate_along_flow(self.jacobian, state)
        found = self.jacobian_rate_function(state.read_only)
        return self._matrix(found, "jacobian_rate_function", state)

    def evaluate(
        self,
        state: RobotState,
        out: TaskSample | None = None,
        feedback: Feedback | None = None,
    ) -> TaskSample:
        """Return J, J', e, e' and a_x; see `Task.evaluate`."""
        out, feedback = self.given(state, out, feedback)
        desired = self._reference_at(state)
        out.jacobian[:] = self.jacobian(state)
        out.jacobian_dot[:] = self.jacobian_rate(state)
        out.error[:] = desired.position - self.value(state)
        out.error_rate[:] = desired.velocity - self.rate(state)
        moves = rate_along_flow(self.rate, state) - out.jacobian_dot @ state.v
        fed_back = feedback.acceleration(out.error, out.error_rate)
        out.acceleration[:] = desired.acceleration - moves + fed_back
        return out

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' - ∂y/∂t, shape (m,)."""
        moves = self.rate(state) - self.jacobian(state) @ state.v
        return np.asarray(self._reference_at(state).velocity - moves)

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return x_d and y, shapes (m,)."""
        return self._reference_at(state).position.copy(), self.value(state)

    # --- results of functions --------------------------------------------------------

    def _numbers(self, value: object, what: str, *shape: int) -> Array:
        """Return the result of a function as an array of finite numbers."""
        try:
            array = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            array = np.full(1, np.nan)
        if shape == (1,) and array.shape == ():
            array = array.reshape(1)
        if array.shape != shape or not np.isfinite(array).all():
            many = " x ".join(map(str, shape))
            other = what == "function" and array.ndim == 1 and array.size > 0
            other = other and np.isfinite(array).all()
            raise TaskError(
                f"task {self.name!r}: {what} returned {value!r}; needs {many} finite "
                f"number{'' if shape == (1,) else 's'}"
                + (f", or size={array.size}" if other else "")
            )
        return array

    def _matrix(self, value: Any, what: str, state: RobotState) -> Array:
        """Return J or J'; of one row, a vector will do."""
        nv = state.robot.nv
        if self.size == 1 and np.shape(value) == (nv,):
            value = np.asarray(value)[None, :]
        return self._numbers(value, what, self.size, nv)
