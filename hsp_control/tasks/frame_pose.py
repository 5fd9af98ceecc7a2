"""The task of a frame's pose: its origin and its orientation together."""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.rotations import quaternion_from_rotation
from hsp_control.common.step_plan import merged
from hsp_control.declaration import AnyOf
from hsp_control.geometry.start import Start
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import FrameKinematics, FrameMotion
from hsp_control.tasks.compliant_task import CompliantTask
from hsp_control.tasks.frame_orientation import (
    ORIENTATION_SCRATCH,
    orientation_acceleration,
    orientation_error,
)
from hsp_control.tasks.frame_task import FrameTask, TrackingTask, frame_of, place_pose
from hsp_control.tasks.impedance_gains import Rotating
from hsp_control.tasks.task import Drawn, ErrorPart, Feedback, add_feedback, copy_rows
from hsp_control.trajectories import (
    ComposedPose,
    PoseSample,
    PoseTrajectory,
    Trajectory,
)
from hsp_control.trajectories.following import Follower

PoseOrPoint = Annotated[PoseTrajectory | Trajectory, AnyOf(PoseTrajectory, Trajectory)]
"""The trajectory of a pose, or of its origin: then the orientation is held."""

POSE_ERROR = (
    ErrorPart("position", "m", "m/s", 3),
    ErrorPart("orientation", "rad", "rad/s", 3),
)


class FramePose(FrameTask, TrackingTask, CompliantTask, type="frame_pose"):
    """e = (x_d - x, -log(R_dᵀ R)), the pose of a frame in the world [m, rad].

    Position rows are in world axes; orientation rows are those of `FrameOrientation`.
    The two errors are decoupled and exactly linear, and the origin returns on a
    straight line. With the logarithm on SE(3) it would return on a screw
    (docs/law.md).
    """

    drawn: ClassVar[tuple[Drawn, ...]] = ("position", "orientation")
    wrench_unit: ClassVar[str | None] = "N and N·m"

    trajectory: PoseOrPoint = ComposedPose()
    """The desired pose, world ← frame, or the trajectory of its origin, with the
    orientation of the start [m, rad]; held at the start by default."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """Position and rotation vector."""
        return POSE_ERROR

    @property
    def pose(self) -> PoseTrajectory:
        """The trajectory of a placed task."""
        if not isinstance(self.trajectory, PoseTrajectory):
            raise self._not_placed("orientation")
        return self.trajectory

    @property
    def followed(self) -> PoseTrajectory:
        """The trajectory of a placed task."""
        return self.pose

    def placed(self, start: Start) -> Self:
        """Return the task with its trajectory in the world; see `Task.placed`."""
        robot = start.state.robot
        frame = frame_of(self.frame, robot)
        motion = start.state.frame(frame)
        here = pin.SE3(motion.rotation, motion.position)
        trajectory = place_pose(self.trajectory, here, self.blend)
        placed = replace(self, frame=frame, trajectory=trajectory, blend=None)
        return placed.checked(robot)

    def _compile(
        self, frame: FrameKinematics, feedback: Feedback, out: TaskSample
    ) -> tuple[Follower, Callable[[], Any]]:
        desired = np.zeros((8, 3))
        write = bind(
            pose_error_equation,
            frame.motion,
            desired,
            feedback,
            np.zeros((ORIENTATION_SCRATCH, 3)),
            out,
        )
        return self.pose.follow(PoseSample.over(desired)), write

    def _rotating(self, state: RobotState) -> Rotating:
        motion = state.frame(self.frame_name).motion
        return Rotating(3, motion.rotation, motion.velocity[3:])

    def _reference(self, state: RobotState) -> "_Reference":
        """Return the reference at the state's time; the state keeps the memory."""

        def make() -> _Reference:
            desired, values = np.zeros((8, 3)), np.zeros((2, 7))
            sample, frame = PoseSample.over(desired), state.frame(self.frame_name)
            place = frame.position, frame.rotation
            measure = bind(_measured_pose, desired, *place, values)
            return _Reference(sample, merged(self.pose.follow(sample)), measure, values)

        reference = state.made(self, "reference", make)
        reference.follow(state.t)
        return reference

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' and w_d in world axes, shape (6,) [m/s, rad/s]."""
        sample = self._reference(state).sample
        velocity, turning = (
            sample.position.velocity,
            sample.orientation.angular_velocity,
        )
        return np.concatenate([velocity, turning])

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual pose: x, y, z [m], quaternion (x, y, z, w)."""
        state.frame(self.frame_name)
        reference = self._reference(state)
        reference.measure()
        desired, actual = reference.values.copy()
        return desired, actual


class _Reference(NamedTuple):
    """The reference of a pose at a state's time."""

    sample: PoseSample
    follow: Callable[[float], object]  # writes it for a time [s]
    measure: Callable[[], object]  # writes `values` for the reference and the frame
    values: Array  # what `FramePose.measure` returns, (2, 7)


@kernel
def _measured_pose(desired: Array, position: Array, R: Array, values: Array) -> None:
    """Write the desired and the actual pose; see `FramePose.measure`."""
    for i in range(3):
        values[0, i], values[1, i] = desired[0, i], position[i]
    quaternion_from_rotation(desired[3:6], values[0, 3:])
    quaternion_from_rotation(R, values[1, 3:])
    alike = 0.0
    for i in range(3, 7):
        alike += values[0, i] * values[1, i]
    if alike < 0.0:
        for i in range(3, 7):
            values[1, i] *= -1.0


@kernel
def pose_error_equation(
    frame: FrameMotion,
    desired: Array,
    feedback: Feedback,
    scratch: Array,
    out: TaskSample,
) -> None:
    """Write the sample of a pose task; gains may couple position and orientation.

    ``desired`` has shape (8, 3): x, x', x'', R (three rows), ω, ω', see
    `PoseSample.over`.
    """
    J_frame, J_frame_dot, R, position, velocity = frame
    J, J_dot, e, e_dot, a_x = out
    copy_rows(J_frame, J_frame_dot, 0, J, J_dot)
    for i in range(3):
        e[i] = desired[0, i] - position[i]
        e_dot[i] = desired[1, i] - velocity[i]
        a_x[i] = desired[2, i]
        a_x[3 + i] = 0.0
    R_d, w_d, w_d_dot = desired[3:6], desired[6], desired[7]
    w, angle, angle_dot, turning = velocity[3:], e[3:], e_dot[3:], a_x[3:]
    orientation_error(R, w, R_d, w_d, scratch, angle, angle_dot)
    add_feedback(a_x, feedback, e, e_dot, a_x)
    orientation_acceleration(R, w, w_d, w_d_dot, angle, angle_dot, scratch, turning)
