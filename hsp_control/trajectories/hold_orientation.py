"""A constant orientation."""

from numpy.typing import ArrayLike

from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Follower, stay
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)


class HoldOrientation(OrientationTrajectory):
    """R(t) = R0, a constant orientation.

    Attributes:
        rotation: R0, body to world, shape (3, 3).
    """

    __slots__ = ("rotation",)

    def __init__(self, rotation: ArrayLike) -> None:
        """Set R0, body to world, shape (3, 3).

        Raises:
            TrajectoryError: If it is not a rotation matrix.
        """
        self.rotation = checks.rotation(rotation, "rotation")

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R0 and zero rates; see `OrientationTrajectory.sample`."""
        if out is None:
            out = OrientationSample.allocate()
        out.rotation[:] = self.rotation
        out.angular_velocity.fill(0.0)
        out.angular_acceleration.fill(0.0)
        return out

    def follow(self, out: OrientationSample) -> Follower:
        """Write ``out`` once, and return a follower that does nothing."""
        self.sample(0.0, out)
        return stay
