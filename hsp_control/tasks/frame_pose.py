"""The tasks of a frame's orientation on SO(3), and of its pose."""

from abc import abstractmethod
from dataclasses import KW_ONLY
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.declaration import AnyOf
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.rotation import AnyRotation
from hsp_control.engine.plans import PartCall
from hsp_control.engine.rotations import quaternion_from_rotation
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import FrameKinematics, FrameMotion
from hsp_control.tasks.compliant_task import CompliantTask, Rotating
from hsp_control.tasks.feedback import ErrorPart
from hsp_control.tasks.frame_task import (
    FrameTask,
    TrackingTask,
    place_orientation,
    place_pose,
)
from hsp_control.tasks.task import Drawn
from hsp_control.trajectories import (
    ComposedPose,
    HoldOrientation,
    OrientationTrajectory,
    PoseTrajectory,
    Trajectory,
)
from hsp_control.trajectories.pose import AnyPose


class FrameOrientation(
    FrameTask, TrackingTask, CompliantTask, type="frame_orientation"
):
    """e = -log(R_dᵀ R), the orientation of a frame in the world [rad].

    e is a rotation vector in the axes of the desired frame. The error equation is
    exact up to an angle of pi (docs/law.md). At pi the shortest rotation back changes
    its direction: e jumps to -e, and all values stay finite. J are the angular rows of
    the frame's Jacobian in world axes.
    """

    drawn: ClassVar[tuple[Drawn, ...]] = ("orientation",)
    wrench_unit: ClassVar[str | None] = "N·m"

    trajectory: Given[OrientationTrajectory, AnyRotation] = default(HoldOrientation())
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

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Task.call`."""
        frame = state.frame(self.frame_name)
        return PartCall(engine.TrackOrientation, frame=frame, desired=self.trajectory)

    def _rotating(self, state: RobotState) -> Rotating:
        motion = state.frame(self.frame_name).motion
        return Rotating(0, motion.rotation, motion.velocity[3:])

    def reference_rate(self, state: RobotState) -> Array:
        """Return w_d minus the frame's rotation in its joint, shape (3,) [rad/s]."""
        own = state.frame(self.frame_name).own_velocity[3:]
        rate: Array = self._reference_at(state).angular_velocity - own
        return rate

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual orientation, quaternions (x, y, z, w)."""
        desired = self._reference_at(state).rotation
        return _quaternions(desired, state.frame(self.frame_name).rotation)


def _quaternions(desired: Array, actual: Array) -> tuple[Array, Array]:
    """Return two rotations as quaternions, with the nearer of the signs q and -q."""
    q_d, q = quaternion_from_rotation(desired), quaternion_from_rotation(actual)
    return q_d, q if q_d @ q >= 0.0 else -q


PoseOrPoint = Given[
    Annotated[PoseTrajectory | Trajectory, AnyOf(PoseTrajectory, Trajectory)],
    AnyPose,
]
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
    def moving(self, state: RobotState) -> FrameMotion:
        """Return the motion of the frame in the reference's axes."""

    def reference_rate(self, state: RobotState) -> Array:
        """Return x_d' and w_d in the reference's axes, shape (6,) [m/s, rad/s].

        Minus the frame's motion in its joint.
        """
        sample = self._reference_at(state)
        velocity, turning = sample.position.velocity, sample.orientation
        rate = np.concatenate([velocity, turning.angular_velocity])
        return np.asarray(rate - self.moving(state).own_velocity)

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual pose: x, y, z [m], quaternion (x, y, z, w)."""
        sample, here = self._reference_at(state), self.moving(state)
        desired, actual = np.empty((2, 7))
        desired[:3], actual[:3] = sample.position.position, here.position
        turned = sample.orientation.rotation
        desired[3:], actual[3:] = _quaternions(turned, here.rotation)
        return desired, actual


class FramePose(FrameTask, PoseTask, CompliantTask, type="frame_pose"):
    """e = (x_d - x, -log(R_dᵀ R)), the pose of a frame in the world [m, rad].

    Position rows are in world axes, or with ``along="tool"`` in those of the desired
    frame, R_dᵀ(x_d - x); orientation rows are those of `FrameOrientation`. The two
    errors are decoupled and exactly linear, and the origin returns on a straight line.
    With the logarithm on SE(3) it would return on a screw (docs/law.md).

    In Python a pose that is held may be given directly: ``FramePose("hand",
    pin.SE3(...))``, or x, y, z and a quaternion (x, y, z, w), or x, y, z.
    """

    drawn: ClassVar[tuple[Drawn, ...]] = ("position", "orientation")
    wrench_unit: ClassVar[str | None] = "N and N·m"

    trajectory: PoseOrPoint = default(ComposedPose())
    """The desired pose, world ← frame, or the trajectory of its origin, with the
    orientation of the start [m, rad]; held at the start by default."""
    _: KW_ONLY
    along: Literal["world", "tool"] = "world"
    """Axes of the position rows, and so of gains, stiffness and forces: the world's, or
    those of the desired frame of the tool [-]."""

    def _placed_at(self, here: FrameKinematics) -> dict[str, Any]:
        place = pin.SE3(here.rotation, here.position)
        trajectory = place_pose(self.trajectory, place, self.blend)
        return {"trajectory": trajectory, "blend": None}

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Task.call`."""
        frame = state.frame(self.frame_name)
        turning = self.along == "tool"
        return PartCall(
            engine.TrackPose, frame=frame, desired=self.followed, turning=turning
        )

    def reference_rate(self, state: RobotState) -> Array:
        """Return R_dᵀ x_d' or x_d', along the rows' axes, and w_d [m/s, rad/s]."""
        rate = super().reference_rate(state)
        if self.along == "tool":
            rate[:3] = self._reference_at(state).orientation.rotation.T @ rate[:3]
        return rate

    def _rotating(self, state: RobotState) -> Rotating:
        motion = state.frame(self.frame_name).motion
        return Rotating(3, motion.rotation, motion.velocity[3:])

    def moving(self, state: RobotState) -> FrameMotion:
        """Return the motion of the frame in the world."""
        return state.frame(self.frame_name).motion
