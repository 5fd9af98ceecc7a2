"""A constant point."""

from numpy.typing import ArrayLike

from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Follower, stay
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample


class Hold(Trajectory):
    """x(t) = x0, a constant point.

    Attributes:
        point: x0, shape (n,).
    """

    __slots__ = ("point",)

    def __init__(self, point: ArrayLike) -> None:
        """Set the point x0, shape (n,).

        Raises:
            TrajectoryError: If it is not an array of finite numbers, shape (n,).
        """
        self.point = checks.array(point, "point", (None,))

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return len(self.point)

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return x0 and zero rates; see `Trajectory.sample`."""
        out = self._output(out)
        out.position[:] = self.point
        out.velocity.fill(0.0)
        out.acceleration.fill(0.0)
        return out

    def follow(self, out: TrajectorySample) -> Follower:
        """Write ``out`` once, and return a follower that does nothing."""
        self.sample(0.0, out)
        return stay
