"""The task of a frame's origin, along all world axes or some of them."""

from dataclasses import KW_ONLY
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.quantities import Axes
from hsp_control.engine.plans import PartCall
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks.compliant_task import CompliantTask
from hsp_control.tasks.feedback import ErrorPart
from hsp_control.tasks.frame_task import FrameTask, TrackingTask, place_point
from hsp_control.tasks.task import Drawn
from hsp_control.trajectories import Hold, Trajectory


class FramePosition(FrameTask, TrackingTask, CompliantTask, type="frame_position"):
    """e = x_d - x, the position of a frame's origin in world axes [m].

    J are the linear rows of the frame's Jacobian in world axes;
    a_x = x_d'' + Kv e' + Kp e + offset.
    """

    drawn: ClassVar[tuple[Drawn, ...]] = ("position",)
    wrench_unit: ClassVar[str | None] = "N"

    trajectory: Given[Trajectory, ArrayLike] = default(Hold())
    """x_d(t), the trajectory of the origin [m]; held at the start by default."""
    _: KW_ONLY
    axes: Axes = "xyz"
    """World axes that are tracked, in the trajectory's order, such as ``xy`` [-]."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The position along the tracked axes."""
        return (ErrorPart("position", "m", "m/s", len(self.axes)),)

    def _placed_at(self, here: FrameKinematics) -> dict[str, Any]:
        begin = here.position[axis_indices(self.axes)]
        trajectory = place_point(self.trajectory, begin, self.blend)
        return {"trajectory": trajectory, "blend": None}

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Task.call`."""
        return PartCall(
            engine.TrackAxes,
            axes=axis_indices(self.axes),
            point=state.frame(self.frame_name).point,
            desired=self.trajectory,
        )

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' minus the frame's motion in its joint, shape (m,) [m/s]."""
        own = state.frame(self.frame_name).own_velocity[axis_indices(self.axes)]
        rate: Array = self._reference_at(state).velocity - own
        return rate

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return x_d and x along the tracked axes, shapes (m,) [m]."""
        desired = self._reference_at(state).position.copy()
        return desired, state.position(self.frame_name)[axis_indices(self.axes)]


def axis_indices(axes: str) -> Indices:
    """Return the indices of axes: [0, 2] for ``"xz"``."""
    return np.array(["xyz".index(letter) for letter in axes], dtype=np.int64)
