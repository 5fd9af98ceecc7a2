"""References that jump to a goal and stay there, like set points."""

from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.trajectories import (
    OrientationSample,
    OrientationTrajectory,
    Trajectory,
    TrajectorySample,
)


class HeldPoint(Trajectory):
    """x(t) = the last goal, at rest; before the first one, the start of the robot.

    The error equation e'' + Kv e' + Kp e = 0 holds between jumps. A stream has none.
    """

    def aim(self, goal: ArrayLike) -> None:
        """Jump to a goal, shape (n,) [m]."""
        vars(self)["_goal"] = np.array(goal, dtype=float)

    @property
    def relative(self) -> bool:
        """Whether it has no goal yet."""
        return "_goal" not in vars(self)

    @property
    def dimension(self) -> int:
        """The number n of coordinates; 0 before there is a goal."""
        return 0 if self.relative else len(self._goal)

    def anchored(self, start: ArrayLike | None) -> Self:
        """Return the reference itself, now where the robot starts."""
        assert start is not None
        self.aim(start)
        return self

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return the goal and zero rates; see `Trajectory.sample`."""
        out = self._output(out)
        out.position[:] = self._goal
        out.velocity.fill(0.0)
        out.acceleration.fill(0.0)
        return out

    @property
    def _goal(self) -> Array:
        goal: Array = vars(self)["_goal"]
        return goal


class HeldRotation(OrientationTrajectory):
    """R(t) = the last goal, at rest; before the first one, the start of the robot."""

    def aim(self, goal: ArrayLike) -> None:
        """Jump to a rotation, body to world, shape (3, 3)."""
        vars(self)["_goal"] = np.array(goal, dtype=float)

    @property
    def relative(self) -> bool:
        """Whether it has no goal yet."""
        return "_goal" not in vars(self)

    def anchored(self, start: ArrayLike) -> Self:
        """Return the reference itself, now as the robot starts."""
        self.aim(start)
        return self

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return the goal and zero rates; see `OrientationTrajectory.sample`."""
        out = self._output(out)
        out.rotation[:] = vars(self)["_goal"]
        out.angular_velocity.fill(0.0)
        out.angular_acceleration.fill(0.0)
        return out
