"""The angular momentum about the centre of mass follows a trajectory."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task, TaskSample
from hsp_control.trajectories import Trajectory, TrajectorySample


class AngularMomentum(Task):
    """Angular momentum about the centre of mass, per mass: ℓ = A v / m [m²/s].

    Momentum has no configuration that it is the rate of, so that its error equation is
    of first order, and exact: e' + K e = 0 with e = ℓ_d - ℓ, by ℓ' = ℓ_d' + K e. Per
    mass its rows are of the size of a position's, which the singularity threshold
    compares them with.
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
            name: What the log calls it.

        Raises:
            TaskError: If the trajectory has another dimension.
            GainError: If the rate is not positive.
        """
        # (s + K)² has the same decay; the gains say what `Gains` would of e' + K e.
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
        """Return the three rows; e' is what the law makes it, -K e."""
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
        """Return ℓ_d [m²/s]: what J v is on the reference."""
        return self.trajectory.sample(state.t).position

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual angular momentum per mass [m²/s]."""
        mass = state.centroidal
        actual = mass.momentum_matrix @ state.v / mass.mass
        return self.trajectory.sample(state.t).position, actual
