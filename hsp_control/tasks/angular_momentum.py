"""The task of the angular momentum about the centre of mass."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task, TaskSample
from hsp_control.trajectories import Trajectory, TrajectorySample


class AngularMomentum(Task):
    """e' + K e = 0 with e = ℓ_d - ℓ, ℓ = A v / m the angular momentum per mass [m²/s].

    In world axes, about the centre of mass; J = A / m, a_x = ℓ_d' + K e. The error
    equation is exact and of first order, because angular momentum is not the rate of
    any function of the configuration. Divided by the mass, the rows of J have the same
    size as those of a position, with which the singularity threshold compares them.

    Attributes:
        rate: K [1/s].
        trajectory: ℓ_d(t).
    """

    def __init__(
        self,
        robot: Robot,
        trajectory: Trajectory,
        rate: float,
        *,
        name: str = "angular_momentum",
    ) -> None:
        """Set the task.

        Args:
            robot: The robot.
            trajectory: ℓ_d(t) in world axes [m²/s], of dimension 3; its velocity is
                ℓ_d'.
            rate: K > 0 [1/s].
            name: Name of the task in the log.

        Raises:
            TaskError: If the trajectory has another dimension, or the robot has fewer
                than three degrees of freedom.
            GainError: If the rate is not positive.
        """
        # `Gains` needs Kp and Kv, which `evaluate` does not use. Those of (s + K)² have
        # the same decay, and `Gains` checks K.
        super().__init__(robot, 3, Gains.from_frequency(rate), name)
        if trajectory.dimension != 3:
            raise TaskError(
                f"task {name!r}: its trajectory has dimension {trajectory.dimension}, "
                "needs 3"
            )
        self.rate = float(rate)
        self.trajectory = trajectory
        self._desired = TrajectorySample.allocate(3)

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return the three rows, with e' = -K e; see `Task.evaluate`."""
        out = self._out(out)
        mass = state.centroidal
        desired = self.trajectory.sample(state.t, self._desired)
        np.divide(mass.momentum_matrix, mass.mass, out=out.jacobian)
        np.divide(mass.momentum_matrix_dot, mass.mass, out=out.jacobian_dot)
        out.error[:] = desired.position - out.jacobian @ state.v
        out.error_rate[:] = -self.rate * out.error
        out.acceleration[:] = desired.velocity - out.error_rate + self.offset
        return out

    def reference_rate(self, state: RobotState) -> Array:
        """Return ℓ_d, shape (3,) [m²/s]."""
        return self.trajectory.sample(state.t).position

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return ℓ_d and ℓ in world axes, shape (3,) each [m²/s]."""
        mass = state.centroidal
        actual = mass.momentum_matrix @ state.v / mass.mass
        return self.trajectory.sample(state.t).position, actual
