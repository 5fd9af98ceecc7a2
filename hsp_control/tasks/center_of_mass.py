"""The centre of mass follows a trajectory."""

from collections.abc import Sequence
from functools import partial

from hsp_control.arrays import Array, Indices
from hsp_control.bound import Bound
from hsp_control.exceptions import TaskError
from hsp_control.kernels import bind, kernel
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.axes import axis_indices
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import CompiledTask, TaskSample, track
from hsp_control.trajectories import Trajectory, TrajectorySample


class CenterOfMass(CompiledTask):
    """Centre of mass in the world: e = c_d - c, exactly linear.

    Attributes:
        axes: World axes that are tracked, such as ``"xyz"`` or ``"xy"``.
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
            trajectory: c_d(t) of the tracked axes [m], of dimension ``len(axes)``.
            gains: Feedback gains.
            axes: World axes that are tracked, in the trajectory's order.
            name: What the log calls it.

        Raises:
            TaskError: If the axes are not distinct letters of "xyz", or the trajectory
                has another dimension.
            GainError: If the gains do not fit.
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

    def _calls(self, state: RobotState, out: TaskSample) -> Bound:
        mass, desired = state.centroidal, TrajectorySample.allocate(self.rows)
        write = bind(
            _center_of_mass,
            mass.jacobian,
            mass.jacobian_dot,
            mass.position,
            mass.velocity,
            self._axes,
            *desired,
            self.Kp,
            self.Kv,
            self.offset,
            *out,
        )
        centroidal = partial(getattr, state, "centroidal")
        return Bound((self.trajectory.follow(desired),), (centroidal, write))

    def reference_rate(self, state: RobotState) -> Array:
        """Return c_d' [m/s]."""
        return self.trajectory.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual centre of mass along the tracked axes [m]."""
        desired = self.trajectory.sample(state.t)
        return desired.position, state.centroidal.position[self._axes]


@kernel
def _center_of_mass(
    J_mass: Array,
    J_mass_dot: Array,
    c: Array,
    c_dot: Array,
    axes: Indices,
    x_d: Array,
    x_d_dot: Array,
    x_d_ddot: Array,
    Kp: Array,
    Kv: Array,
    offset: Array,
    J: Array,
    J_dot: Array,
    e: Array,
    e_dot: Array,
    a_x: Array,
) -> None:
    """Write the sample of the tracked axes."""
    for k in range(axes.shape[0]):
        axis = axes[k]
        for j in range(J.shape[1]):
            J[k, j] = J_mass[axis, j]
            J_dot[k, j] = J_mass_dot[axis, j]
        e[k] = x_d[k] - c[axis]
        e_dot[k] = x_d_dot[k] - c_dot[axis]
        a_x[k] = x_d_ddot[k]
    track(a_x, Kp, Kv, offset, e, e_dot, a_x)
