"""The task of the centre of mass."""

from collections.abc import Sequence
from functools import partial

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.axes import axis_indices, track_axes
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import CompiledTask, TaskSample
from hsp_control.trajectories import Trajectory, TrajectorySample


class CenterOfMass(CompiledTask):
    """e = c_d - c, the centre of mass in world axes [m].

    a_x = c_d'' + Kv e' + Kp e + offset; J is the Jacobian of the centre of mass.

    Attributes:
        axes: World axes that are tracked, such as ``"xyz"`` or ``"xy"``.
        trajectory: c_d(t).
    """

    def __init__(
        self,
        robot: Robot,
        trajectory: Trajectory,
        gains: Gains,
        *,
        axes: str | Sequence[str] = "xyz",
        name: str = "center_of_mass",
    ) -> None:
        """Set the task.

        Args:
            robot: The robot.
            trajectory: c_d(t) along the tracked axes [m], of dimension ``len(axes)``.
            gains: Feedback gains of the rows.
            axes: World axes that are tracked, in the trajectory's order.
            name: Name of the task in the log.

        Raises:
            TaskError: If the axes are not distinct letters of "xyz", or the trajectory
                has another dimension.
            GainError: If the gains do not fit the rows.
        """
        self._axes = axis_indices(axes)
        super().__init__(robot, len(self._axes), gains, name)
        self.axes = "".join(axes)
        if trajectory.dimension != self.rows:
            raise TaskError(
                f"task {name!r} tracks the axes {self.axes!r}; its trajectory has "
                f"dimension {trajectory.dimension}, needs {self.rows}"
            )
        self.trajectory = trajectory

    def _step_plan(self, state: RobotState, out: TaskSample) -> StepPlan:
        mass, desired = state.centroidal, TrajectorySample.allocate(self.rows)
        write = bind(
            track_axes,
            self._axes,
            mass.jacobian,
            mass.jacobian_dot,
            mass.position,
            mass.velocity,
            desired,
            self.feedback,
            out,
        )
        centroidal = partial(getattr, state, "centroidal")
        return StepPlan((self.trajectory.follow(desired),), (centroidal, write))

    def reference_rate(self, state: RobotState) -> Array:
        """Return c_d', shape (m,) [m/s]."""
        return self.trajectory.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return c_d and c along the tracked axes, shape (m,) each [m]."""
        desired = self.trajectory.sample(state.t)
        return desired.position, state.centroidal.position[self._axes]
