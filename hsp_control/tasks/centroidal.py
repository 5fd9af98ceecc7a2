"""The tasks of the centre of mass, and of the angular momentum about it."""

from dataclasses import KW_ONLY, replace
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.quantities import Axes, Positive
from hsp_control.engine.plans import PartCall
from hsp_control.geometry.scene import Start
from hsp_control.law import TaskSample
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.feedback import ErrorPart, Feedback
from hsp_control.tasks.frame_position import axis_indices
from hsp_control.tasks.frame_task import TrackingTask, place_point
from hsp_control.tasks.task import Task
from hsp_control.trajectories import Hold, Trajectory


class CenterOfMass(TrackingTask, type="center_of_mass"):
    """e = c_d - c, the centre of mass in world axes [m].

    a_x = c_d'' + Kv e' + Kp e + offset; J is the Jacobian of the centre of mass.
    """

    trajectory: Given[Trajectory, ArrayLike] = default(Hold())
    """c_d(t), the trajectory of the centre of mass [m]; held by default."""
    _: KW_ONLY
    axes: Axes = "xyz"
    """World axes that are tracked, in the trajectory's order, such as ``xy`` [-]."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The position along the tracked axes."""
        return (ErrorPart("position", "m", "m/s", len(self.axes)),)

    def keeps_balance(self, robot: Robot) -> bool:
        """Return True: see `Task.keeps_balance`."""
        return True

    def placed(self, start: Start) -> Self:
        """Return the task with its trajectory in the world; see `Task.placed`."""
        here = start.state.centroidal.position[axis_indices(self.axes)]
        trajectory = place_point(self.trajectory, here, self.blend)
        placed = replace(self, trajectory=trajectory, blend=None)
        return placed.checked(start.state.robot)

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Task.call`."""
        return PartCall(
            engine.TrackAxes,
            axes=axis_indices(self.axes),
            point=state.centroidal,
            desired=self.trajectory,
        )

    def reference_rate(self, state: RobotState) -> Array:
        """Return c_d', shape (m,) [m/s]."""
        return self.trajectory.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return c_d and c along the tracked axes, shapes (m,) [m]."""
        desired = self.trajectory.sample(state.t)
        return desired.position, state.centroidal.position[axis_indices(self.axes)]


class AngularMomentum(Task, type="angular_momentum"):
    """e' + K e = 0 with e = ℓ_d - ℓ, ℓ = A v / m the angular momentum per mass [m²/s].

    In world axes, about the centre of mass; J = A / m, a_x = ℓ_d' + K e. The error
    equation is exact and of first order, because angular momentum is not the rate of a
    function of the configuration. Divided by the mass, the rows of J are of the size of
    a position's, as the singularity threshold assumes.
    """

    order: ClassVar[Literal[1, 2]] = 1

    trajectory: Given[Trajectory, ArrayLike] = default(Hold((0.0, 0.0, 0.0)))
    """ℓ_d(t) in world axes [m²/s], of dimension 3; its velocity is ℓ_d'. Zero by
    default."""
    rate: Positive = 10.0
    """K, the rate at which the error decays [1/s]."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The angular momentum per mass."""
        return (ErrorPart("angular momentum", "m²/s", "m²/s²", 3),)

    def keeps_balance(self, robot: Robot) -> bool:
        """Return True: see `Task.keeps_balance`."""
        return True

    def feedback(self) -> Feedback:
        """Return new arrays of feedback: Kp = K and Kv = 1, for e' + K e = 0."""
        return Feedback(self.rate * np.eye(3), np.eye(3), np.zeros(3))

    def placed(self, start: Start) -> Self:
        """Return the task with its trajectory about zero; see `Task.placed`."""
        trajectory = place_point(self.trajectory, np.zeros(3), None)
        return replace(self, trajectory=trajectory).checked(start.state.robot)

    def evaluate(
        self,
        state: RobotState,
        out: TaskSample | None = None,
        feedback: Feedback | None = None,
    ) -> TaskSample:
        """Return the three rows, with e' = -K e; see `Task.evaluate`."""
        out, feedback = self.given(state, out, feedback)
        mass = state.centroidal
        desired = self.trajectory.sample(state.t)
        np.divide(mass.momentum_matrix, mass.mass, out=out.jacobian)
        np.divide(mass.momentum_matrix_dot, mass.mass, out=out.jacobian_dot)
        out.error[:] = desired.position - out.jacobian @ state.v
        out.error_rate[:] = -(feedback.Kp @ out.error)
        wanted = desired.velocity - out.error_rate + feedback.offset
        out.acceleration[:] = wanted - mass.own_momentum
        return out

    def reference_rate(self, state: RobotState) -> Array:
        """Return ℓ_d, shape (3,) [m²/s]."""
        return self.trajectory.sample(state.t).position

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return ℓ_d and ℓ in world axes, shapes (3,) [m²/s]."""
        mass = state.centroidal
        actual = mass.momentum_matrix @ state.v / mass.mass
        return self.trajectory.sample(state.t).position, actual
