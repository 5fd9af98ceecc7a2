"""The tasks of a frame's orientation on SO(3), and of its pose."""

from abc import abstractmethod
from typing import Annotated, Any, ClassVar

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.compiled.linalg import multiply
from hsp_control.compiled.rotations import (
    compose_back,
    cross,
    jexp3,
    jexp3_dot,
    jlog3,
    log3,
    rotate,
    rotate_back,
)
from hsp_control.declaration import AnyOf
from hsp_control.engine.rotations import quaternion_from_rotation
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import FrameKinematics, FrameMotion, copy_rows
from hsp_control.tasks.compliant_task import CompliantTask
from hsp_control.tasks.feedback import ErrorPart, Feedback, add_feedback
from hsp_control.tasks.frame_task import (
    FrameTask,
    TrackingTask,
    place_orientation,
    place_pose,
)
from hsp_control.tasks.impedance_gains import Rotating
from hsp_control.tasks.task import Drawn
from hsp_control.trajectories import (
    ComposedPose,
    HoldOrientation,
    OrientationSample,
    OrientationTrajectory,
    PoseTrajectory,
    Trajectory,
)

ORIENTATION_SCRATCH = 12
"""Rows of the scratch array of `orientation_error` and `orientation_acceleration`."""


class FrameOrientation(
    FrameTask, TrackingTask, CompliantTask, type="frame_orientation"
):
    """e = -log(R_dᵀ R), the orientation of a frame in the world [rad].

    e is a rotation vector in the axes of the desired frame. The error equation is
    exact up to an angle of pi (docs/law.md). At pi the shortest rotation back changes
    its side: e jumps to -e, and all values stay finite. J are the angular rows of the
    frame's Jacobian in world axes.
    """

    drawn: ClassVar[tuple[Drawn, ...]] = ("orientation",)
    wrench_unit: ClassVar[str | None] = "N·m"

    trajectory: OrientationTrajectory = HoldOrientation()
    """R_d(t), world ← frame [rad]; held as at the start by default."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The rotation vector."""
        return (ErrorPart("orientation", "rad", "rad/s", 3),)

    def _default_name(self) -> str:
        return f"{super()._default_name()}_orientation"

    def _placed_at(self, here: FrameKinematics) -> dict[str, Any]:
        trajectory = place_orientation(self.trajectory, here.rotation, self.blend)
        return {"trajectory": trajectory, "blend": None}

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel; see `Task.kernel`."""
        scratch = np.zeros((ORIENTATION_SCRATCH, 3))
        frame = state.frame(self.frame_name)
        return _track_orientation, (frame, self.trajectory, scratch)

    def _rotating(self, state: RobotState) -> Rotating:
        motion = state.frame(self.frame_name).motion
        return Rotating(0, motion.rotation, motion.velocity[3:])

    def reference_rate(self, state: RobotState) -> Array:
        """Return the desired angular velocity w_d in world axes, shape (3,) [rad/s]."""
        turning: Array = self._reference_at(state).angular_velocity.copy()
        return turning

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual orientation, quaternions (x, y, z, w)."""
        desired = self._reference_at(state).rotation
        return _quaternions(desired, state.frame(self.frame_name).rotation)


def _quaternions(desired: Array, actual: Array) -> tuple[Array, Array]:
    """Return two rotations as quaternions; q and -q are one: of the nearer sign."""
    q_d, q = quaternion_from_rotation(desired), quaternion_from_rotation(actual)
    return q_d, q if q_d @ q >= 0.0 else -q


@kernel
def orientation_error(
    R: Array, w: Array, R_d: Array, w_d: Array, scratch: Array, e: Array, e_dot: Array
) -> None:
    """Write e = -y and e' = -y' with y = log(R_dᵀ R) and y' = Jlog(y) w̃.

    w̃ = Rᵀ(w - w_d) is the relative angular velocity in the axes of the frame.

    Shapes: w (3,) [rad/s], w_d (3,) [rad/s], scratch (ORIENTATION_SCRATCH, 3), e (3,)
    [rad], e_dot (3,) [rad/s].
    """
    w_tilde, y, E = scratch[0], scratch[1], scratch[6:9]
    compose_back(R_d, R, E)
    log3(E, y)
    for i in range(3):
        e[i] = w[i] - w_d[i]
    rotate_back(R, e, w_tilde)
    jlog3(y, E)
    multiply(E, w_tilde, e_dot)
    for i in range(3):
        e[i] = -y[i]
        e_dot[i] = -e_dot[i]


@kernel
def orientation_acceleration(
    R: Array,
    w: Array,
    w_d: Array,
    w_d_dot: Array,
    e: Array,
    e_dot: Array,
    scratch: Array,
    out: Array,
) -> None:
    """Overwrite y'' = -e'' by the angular acceleration w' that produces it.

    w̃ = Jexp(y) y' gives w̃' = Jexp y'' + Jexp' y'. The motion of the desired frame adds
    the transport term: w' = R w̃' - w × w_d + w_d'.

    Shapes: w (3,) [rad/s], w_d (3,) [rad/s], w_d_dot (3,) [rad/s²], e (3,) [rad], e_dot
    (3,) [rad/s], scratch (ORIENTATION_SCRATCH, 3), out (3,) [rad/s²].
    """
    y, y_dot, w_tilde_dot, term = scratch[0], scratch[1], scratch[2], scratch[3]
    for i in range(3):
        y[i], y_dot[i] = -e[i], -e_dot[i]
    J_exp, J_exp_dot = scratch[6:9], scratch[9:12]
    jexp3(y, J_exp)
    jexp3_dot(y, y_dot, J_exp_dot)
    multiply(J_exp, out, w_tilde_dot)
    multiply(J_exp_dot, y_dot, term)
    for i in range(3):
        w_tilde_dot[i] += term[i]
    rotate(R, w_tilde_dot, out)
    cross(w, w_d, term)
    for i in range(3):
        out[i] += w_d_dot[i] - term[i]


@kernel
def _track_orientation(
    frame: FrameMotion,
    desired: OrientationSample,
    scratch: Array,
    feedback: Feedback,
    out: TaskSample,
) -> None:
    """Write the sample: the angular acceleration for which e'' = -Kv e' - Kp e."""
    R, w = frame.rotation, frame.velocity[3:]
    R_d, w_d, w_d_dot = desired
    J, J_dot, e, e_dot, a_x = out
    copy_rows(frame.jacobian, frame.jacobian_dot, 3, J, J_dot)
    orientation_error(R, w, R_d, w_d, scratch, e, e_dot)
    for i in range(3):
        a_x[i] = 0.0
    add_feedback(a_x, feedback, e, e_dot, a_x)
    orientation_acceleration(R, w, w_d, w_d_dot, e, e_dot, scratch, a_x)


PoseOrPoint = Annotated[PoseTrajectory | Trajectory, AnyOf(PoseTrajectory, Trajectory)]
"""The trajectory of a pose, or of its origin: then the orientation is held."""


class PoseTask(TrackingTask):
    """A task whose reference is a pose; a subclass has the field ``trajectory``."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """Position and rotation vector."""
        return (
            ErrorPart("position", "m", "m/s", 3),
            ErrorPart("orientation", "rad", "rad/s", 3),
        )

    @property
    def followed(self) -> PoseTrajectory:
        """The trajectory of a placed task."""
        trajectory = super().followed
        if not isinstance(trajectory, PoseTrajectory):
            raise self._not_placed("orientation")
        return trajectory

    @abstractmethod
    def actual(self, state: RobotState) -> tuple[Array, Array]:
        """Return the actual position (3,) [m] and rotation (3, 3)."""

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' and w_d in the reference's axes, shape (6,) [m/s, rad/s]."""
        sample = self._reference_at(state)
        velocity, turning = sample.position.velocity, sample.orientation
        return np.concatenate([velocity, turning.angular_velocity])

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual pose: x, y, z [m], quaternion (x, y, z, w)."""
        sample, (position, rotation) = self._reference_at(state), self.actual(state)
        desired, actual = np.empty((2, 7))
        desired[:3], actual[:3] = sample.position.position, position
        desired[3:], actual[3:] = _quaternions(sample.orientation.rotation, rotation)
        return desired, actual


class FramePose(FrameTask, PoseTask, CompliantTask, type="frame_pose"):
    """e = (x_d - x, -log(R_dᵀ R)), the pose of a frame in the world [m, rad].

    Position rows are in world axes; orientation rows are those of `FrameOrientation`.
    The two errors are decoupled and exactly linear, and the origin returns on a
    straight line. With the logarithm on SE(3) it would return on a screw
    (docs/law.md).

    Python may give what is held as it is: ``FramePose("hand", pin.SE3(...))``, or x, y,
    z and a quaternion (x, y, z, w), or x, y, z.
    """

    drawn: ClassVar[tuple[Drawn, ...]] = ("position", "orientation")
    wrench_unit: ClassVar[str | None] = "N and N·m"

    trajectory: PoseOrPoint = ComposedPose()
    """The desired pose, world ← frame, or the trajectory of its origin, with the
    orientation of the start [m, rad]; held at the start by default."""

    def _placed_at(self, here: FrameKinematics) -> dict[str, Any]:
        place = pin.SE3(here.rotation, here.position)
        trajectory = place_pose(self.trajectory, place, self.blend)
        return {"trajectory": trajectory, "blend": None}

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel; see `Task.kernel`."""
        scratch = np.zeros((ORIENTATION_SCRATCH, 3))
        return track_pose, (state.frame(self.frame_name), self.followed, scratch)

    def _rotating(self, state: RobotState) -> Rotating:
        motion = state.frame(self.frame_name).motion
        return Rotating(3, motion.rotation, motion.velocity[3:])

    def actual(self, state: RobotState) -> tuple[Array, Array]:
        """Return position and rotation of the frame in the world."""
        frame = state.frame(self.frame_name)
        return frame.position, frame.rotation


@kernel
def track_pose(
    frame: FrameMotion,
    desired: Array,
    scratch: Array,
    feedback: Feedback,
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
