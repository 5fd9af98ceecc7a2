"""The numbers of `Limits` for one robot."""

from dataclasses import dataclass

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.constraints.limits.acceleration_bounds import MotionLimits
from hsp_control.constraints.limits.minimum_distance import MinimumDistance
from hsp_control.constraints.limits.static_effort import StaticEffort
from hsp_control.robot import Robot


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotLimits:
    """The numbers of `Limits` for one robot; they never change.

    The arrays are read-only. Where there is no limit they contain inf, or -inf.

    Attributes:
        robot: The robot.
        effort: Maximum effort, shape (nv,) [N·m or N].
        effort_rate: Maximum rate of effort, shape (nv,) [N·m/s or N/s].
        velocity: Maximum speed, shape (nv,) [rad/s or m/s].
        lower: Lower joint position limit, shape (nv,) [rad or m].
        upper: Upper joint position limit, shape (nv,) [rad or m].
        motion: What the barriers keep: position and velocity limits less their margins,
            the maximum acceleration and α, as a record for kernels.
        distances: The minimum distances.
        static_effort: The limit on the effort against gravity, if any.
    """

    robot: Robot
    effort: Array
    effort_rate: Array
    velocity: Array
    lower: Array
    upper: Array
    motion: MotionLimits
    distances: tuple[MinimumDistance, ...] = ()
    static_effort: StaticEffort | None = None

    @property
    def acceleration(self) -> Array:
        """Maximum acceleration, shape (nv,) [rad/s² or m/s²]."""
        return self.motion.acceleration

    @property
    def guarded_velocity(self) -> Array:
        """The speed that the barriers keep: the limit less its margin, shape (nv,)."""
        return self.motion.velocity

    @property
    def guarded_lower(self) -> Array:
        """The lower position that the barriers keep: the limit plus its margin."""
        return self.motion.lower

    @property
    def guarded_upper(self) -> Array:
        """The upper position that the barriers keep: the limit less its margin."""
        return self.motion.upper

    @property
    def bandwidth(self) -> float:
        """α of the barriers [1/s]."""
        return float(self.motion.bandwidth[0])

    def check_start(self, q: Array, v: Array) -> None:
        """Check that a start is within the limits; distances are those at t = 0.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).

        Raises:
            LimitError: Names the joint, its position or speed, and the limit; or the
                pair of shapes and its distance.
        """
        names = self.robot.dof_names
        positions = self.robot.joint_positions(q)
        outside = np.flatnonzero((positions < self.lower) | (positions > self.upper))
        if outside.size:
            i = outside[0]
            raise LimitError(
                f"the start is outside the limits: {names[i]} is at {positions[i]:.6g},"
                f" its limits are {self.lower[i]:.6g} to {self.upper[i]:.6g}"
            )
        state = self.robot.state(0.0, q, v)
        for each in self.distances:
            each.check_start(state)
        fast = np.flatnonzero(np.abs(v) > self.velocity)
        if fast.size:
            i = fast[0]
            raise LimitError(
                f"the start is outside the limits: {names[i]} moves at {v[i]:.6g}, "
                f"its limit is {self.velocity[i]:.6g}"
            )
