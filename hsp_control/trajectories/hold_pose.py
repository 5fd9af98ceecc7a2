"""A constant pose."""

import pinocchio as pin

from hsp_control.trajectories.hold import Hold
from hsp_control.trajectories.hold_orientation import HoldOrientation
from hsp_control.trajectories.pose import ComposedPose


class HoldPose(ComposedPose):
    """M(t) = M0, a constant pose."""

    __slots__ = ()

    def __init__(self, pose: pin.SE3) -> None:
        """Set M0, body to world.

        Raises:
            TrajectoryError: If M0 is not finite, or its rotation is not a rotation
                matrix.
        """
        super().__init__(Hold(pose.translation), HoldOrientation(pose.rotation))
