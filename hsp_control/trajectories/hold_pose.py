"""A pose that stays."""

import pinocchio as pin

from hsp_control.trajectories.hold import Hold
from hsp_control.trajectories.hold_orientation import HoldOrientation
from hsp_control.trajectories.pose import ComposedPose


class HoldPose(ComposedPose):
    """M(t) = M0."""

    __slots__ = ()

    def __init__(self, pose: pin.SE3) -> None:
        """Stay at ``pose``, body to world."""
        super().__init__(Hold(pose.translation), HoldOrientation(pose.rotation))
