"""An orientation that stays."""

from numpy.typing import ArrayLike

from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Follower, stay
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)


class HoldOrientation(OrientationTrajectory):
    """R(t) = R0.

    Attributes:
        rotation: R0, body to world, shape (3, 3).
    """

    __slots__ = ("rotation",)

    def __init__(self, rotation: ArrayLike) -> None:
        """Stay at ``rotation``, shape (3, 3)."""
        self.rotation = checks.rotation(rotation, "rotation")

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return the orientation, at rest; see `OrientationTrajectory.sample`."""
        if out is None:
            out = OrientationSample.allocate()
        out.rotation[:] = self.rotation
        out.angular_velocity.fill(0.0)
        out.angular_acceleration.fill(0.0)
        return out

    def follow(self, out: OrientationSample) -> Follower:
        """Write ``out`` once and for all; see `Trajectory.follow`."""
        self.sample(0.0, out)
        return stay
