"""The task of the centre of mass."""

from dataclasses import KW_ONLY, replace
from typing import Self

from hsp_control.common.arrays import Array
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.declaration.quantities import Axes
from hsp_control.geometry.start import Start
from hsp_control.law import TaskSample
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.axes import axis_indices, track_axes
from hsp_control.tasks.frame_task import TrackingTask
from hsp_control.tasks.placing import place_point
from hsp_control.tasks.task import ErrorPart, Feedback
from hsp_control.trajectories import Hold, Trajectory, TrajectorySample


class CenterOfMass(TrackingTask, type="center_of_mass"):
    """e = c_d - c, the centre of mass in world axes [m].

    a_x = c_d'' + Kv e' + Kp e + offset; J is the Jacobian of the centre of mass.
    """

    trajectory: Trajectory = Hold()
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

    @property
    def followed(self) -> Trajectory:
        """The trajectory of a placed task."""
        return self.trajectory

    def placed(self, start: Start) -> Self:
        """Return the task with its trajectory in the world; see `Task.placed`."""
        here = start.state.centroidal.position[axis_indices(self.axes)]
        trajectory = place_point(self.trajectory, here, self.blend)
        placed = replace(self, trajectory=trajectory, blend=None)
        return placed.checked(start.state.robot)

    def compile(
        self, state: RobotState, feedback: Feedback, out: TaskSample
    ) -> StepPlan:
        """Return the step plan; see `Task.compile`."""
        mass, desired = state.centroidal, TrajectorySample.allocate(self.rows)
        write = bind(
            track_axes,
            axis_indices(self.axes),
            mass.jacobian,
            mass.jacobian_dot,
            mass.position,
            mass.velocity,
            desired,
            feedback,
            out,
        )
        return StepPlan((self.trajectory.follow(desired),), (mass.compute, write))

    def reference_rate(self, state: RobotState) -> Array:
        """Return c_d', shape (m,) [m/s]."""
        return self.trajectory.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return c_d and c along the tracked axes, shape (m,) each [m]."""
        desired = self.trajectory.sample(state.t)
        return desired.position, state.centroidal.position[axis_indices(self.axes)]
