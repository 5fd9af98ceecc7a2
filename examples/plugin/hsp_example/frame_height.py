"""A task: the height of a frame."""

from dataclasses import replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from hsp_control.declaration import within
from hsp_control.geometry.scene import Start
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState
from hsp_control.tasks import ErrorPart, Feedback, SecondOrderTask
from hsp_control.trajectories import Hold, Trajectory

Array = NDArray[np.float64]


class FrameHeight(SecondOrderTask, type="frame_height"):
    """e = z_d - z, the height of a frame's origin in the world [m]."""

    frame: str | None = None
    """Name of the frame [-]; the robot's end effector by default."""
    trajectory: Trajectory = Hold()
    """z_d(t), of dimension 1 [m]; held at the start by default."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The height."""
        return (ErrorPart("height", "m", "m/s", 1),)

    def placed(self, start: Start) -> Self:
        """Return the task with its frame, and its trajectory in the world."""
        robot = start.state.robot
        frame = robot.end_effector if self.frame is None else self.frame
        with within("frame"):
            here = start.state.position(frame)[2:]
        with within("trajectory"):
            trajectory = self.trajectory.anchored(here)
        return replace(self, frame=frame, trajectory=trajectory).checked(robot)

    def evaluate(
        self,
        state: RobotState,
        out: TaskSample | None = None,
        feedback: Feedback | None = None,
    ) -> TaskSample:
        """Write J, J', e, e' and a_x = z_d'' + Kv e' + Kp s(e) + offset."""
        out, feedback = self.given(state, out, feedback)
        assert self.frame is not None
        frame, desired = state.frame(self.frame), self.trajectory.sample(state.t)
        out.jacobian[:] = frame.jacobian[2:3]
        out.jacobian_dot[:] = frame.jacobian_dot[2:3]
        out.error[:] = desired.position - frame.position[2]
        out.error_rate[:] = desired.velocity - frame.velocity[2]
        fed_back = feedback.acceleration(out.error, out.error_rate)
        out.acceleration[:] = desired.acceleration + fed_back
        return out

    def reference_rate(self, state: RobotState) -> Array:
        """Return z_d', shape (1,) [m/s]."""
        return self.trajectory.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return z_d and z, shapes (1,) [m]."""
        assert self.frame is not None
        desired = self.trajectory.sample(state.t).position
        return desired, state.position(self.frame)[2:].copy()
