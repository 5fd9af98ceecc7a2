"""A constant pose."""

from functools import cached_property

import pinocchio as pin

from hsp_control.declaration.quantities import Vector3
from hsp_control.declaration.rotation import Rotation
from hsp_control.trajectories.following import Follower
from hsp_control.trajectories.hold import Hold
from hsp_control.trajectories.hold_orientation import HoldOrientation
from hsp_control.trajectories.pose import ComposedPose, PoseSample, PoseTrajectory


class HoldPose(PoseTrajectory, type="hold_pose"):
    """M(t) = M0, a constant pose."""

    position: Vector3 | None = None
    """The origin in the world, shape (3,) [m]; where the robot starts by default."""
    rotation: Rotation | None = None
    """The orientation, body to world: roll, pitch and yaw [rad], a quaternion or a
    matrix [-]; that in which the robot starts by default."""

    @property
    def relative(self) -> bool:
        """Whether it depends on where the robot starts."""
        return self.position is None or self.rotation is None

    def anchored(self, start: pin.SE3) -> "HoldPose":
        """Return the pose, where the robot starts if it is not given."""
        return HoldPose(
            start.translation if self.position is None else self.position,
            start.rotation if self.rotation is None else self.rotation,
        )

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose and zero rates; see `PoseTrajectory.sample`."""
        return self._parts.sample(t, out)

    def follow(self, out: PoseSample) -> Follower:
        """Write ``out`` once, and return a follower that does nothing."""
        return self._parts.follow(out)

    @cached_property
    def _parts(self) -> ComposedPose:
        return ComposedPose(Hold(self.position), HoldOrientation(self.rotation))
