"""Limits on efforts, their rate, joint motion and distances."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.constraints.limits.acceleration_bounds import MotionLimits
from hsp_control.constraints.limits.minimum_distance import MinimumDistance
from hsp_control.constraints.limits.static_effort import StaticEffort
from hsp_control.robot import Robot

Default = Literal["robot"]
"""The robot's own limit, from its URDF."""


class Limits:
    """Limits on effort, joint motion and distances, which the controller keeps.

    The limits on efforts and their rate are hard. Those on position, velocity and
    acceleration become bounds on the acceleration, by barriers that let the robot
    approach a limit but not cross it (exponential control barrier functions of
    bandwidth α):

        position        a ≤ α²(q_max - q) - 2α v
        velocity        a ≤ 2α (v_max - v)
        acceleration    a ≤ a_max

    and likewise from below; the velocity barrier is four times as steep within its
    margin. Distances have their own barriers, see `MinimumDistance`; the effort against
    gravity has its own too, see `StaticEffort`. Where limits contradict each other they
    are relaxed in this order: static effort, acceleration, velocity, position,
    distance. Effort limits are never relaxed.

    Where a limit binds, the null space deviates from the law first, and then the tasks.
    If `null_space_speed` is given, the deviation of the null space is bounded: with δ
    the deviation from the law's acceleration, s this speed and λ the decay rate of K_N,
    |(P δ)_j| ≤ λ s_j. Then e_N' = -K_N e_N - P δ is a stable system with a bounded
    input, and ‖e_N‖_W ≤ ‖s‖_|W| at all times, |W| the absolute values of W
    (docs/limits.md). This bound is the first
    of all to be relaxed.

    Attributes:
        robot: The robot.
        effort: Maximum effort, shape (nv,) [N·m or N]; inf where unlimited.
        effort_rate: Maximum rate of effort, shape (nv,) [N·m/s or N/s].
        velocity: Maximum speed, shape (nv,) [rad/s or m/s].
        acceleration: Maximum acceleration, shape (nv,) [rad/s² or m/s²].
        lower: Lower joint position limit, shape (nv,) [rad or m]; -inf where unlimited.
        upper: Upper joint position limit, shape (nv,) [rad or m].
        motion: The same four and α, as a record for kernels.
        guarded_velocity: The speed that the barriers keep: the limit less its margin.
        guarded_lower: The lower position that the barriers keep: the limit plus its
            margin.
        guarded_upper: The upper position that the barriers keep: the limit less its
            margin.
        bandwidth: α of the barriers [1/s].
        distances: The minimum distances.
        static_effort: The limit on the effort against gravity, if any.
        null_space_speed: s, shape (nv,) [rad/s or m/s]; None: no bound.
        null_space_weight: Cost of null-space deviation relative to the first task,
            where limits bind; None: as small as rounding permits.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        effort: Any | Default | None = "robot",
        effort_rate: Any | None = None,
        velocity: Any | Default | None = "robot",
        acceleration: Any | None = None,
        position: tuple[Any, Any] | Default | None = "robot",
        position_margin: float = 0.005,
        velocity_margin: float = 0.02,
        distances: Sequence[MinimumDistance] = (),
        bandwidth: float = 10.0,
        static_effort: float | None = None,
        null_space_speed: Any | None = None,
        null_space_weight: float | None = None,
    ) -> None:
        """Set the limits: each one number, an array of shape (nv,), or None for none.

        Args:
            robot: The robot.
            effort: Maximum effort [N·m or N]; "robot": the URDF's.
            effort_rate: Maximum rate of effort [N·m/s or N/s]; a Panda's is 1000.
            velocity: Maximum speed [rad/s or m/s]; "robot": the URDF's.
            acceleration: Maximum acceleration [rad/s² or m/s²].
            position: (lower, upper) joint positions [rad or m]; "robot": the URDF's.
            position_margin: Distance that is kept from the position limits [rad or m].
                With efforts held for a period, a barrier may be crossed by the error of
                the acceleration over α².
            velocity_margin: Margin that is kept from the speed limits, as a part of
                them, in [0, 1).
            distances: The minimum distances.
            bandwidth: α [1/s]. Motors can follow 5 to 20: faster barriers act so late
                that they need more than the effort rate permits.
            static_effort: The part of an effort that gravity may take, in (0, 1]. It
                holds for motors that are not between the root and a contact. None: no
                limit.
            null_space_speed: s [rad/s or m/s]: how fast the null space may leave the
                field, before tasks deviate. None: no bound.
            null_space_weight: Cost of null-space deviation relative to the first task,
                between 0 and 1. None: 1e-6, and 1e-8 where tasks have priorities. With
                1e-3, a robot that cannot reach its target comes to rest; 1e-3 of the
                null-space deviation then appears in the task.

        Raises:
            LimitError: If a limit is not positive, lower is not below upper, a shape is
                not (nv,), or an option is out of its range.
        """
        self.robot = robot
        nv = robot.nv
        self.effort = _symmetric_limit(robot, effort, "effort", robot.model.effortLimit)
        self.velocity = _symmetric_limit(
            robot, velocity, "velocity", robot.model.velocityLimit
        )
        if not 0.0 <= velocity_margin < 1.0:
            raise LimitError(
                f"velocity_margin is {velocity_margin}; must be at least 0, and below 1"
            )
        self.guarded_velocity = (1.0 - velocity_margin) * self.velocity
        self.effort_rate = _symmetric_limit(robot, effort_rate, "effort_rate", None)
        self.acceleration = _symmetric_limit(robot, acceleration, "acceleration", None)
        if position is None:
            position = (np.full(nv, -np.inf), np.full(nv, np.inf))
        elif isinstance(position, str):
            _check_word(position, "position")
            position = robot.position_limits()
        lower = _array(robot, position[0], "position's lower limit")
        upper = _array(robot, position[1], "position's upper limit")
        if not np.isfinite(position_margin) or position_margin < 0.0:
            raise LimitError(
                f"position_margin is {position_margin}; must be at least 0"
            )
        self.lower, self.upper = lower, upper
        self.guarded_lower = lower + position_margin
        self.guarded_upper = upper - position_margin
        crossed = np.flatnonzero(~(self.guarded_lower < self.guarded_upper))
        if crossed.size:
            i = crossed[0]
            raise LimitError(
                f"position limits of {robot.dof_names[i]} leave no room: "
                f"{lower[i]:.6g} to {upper[i]:.6g} with a margin of {position_margin:g}"
            )
        rooted = robot.dof_indices < 0
        if np.isfinite(lower[rooted]).any() or np.isfinite(upper[rooted]).any():
            raise LimitError(
                "position limits are given for a joint without a single coordinate (a "
                "root, or a continuous joint); leave them infinite"
            )
        if not 0.0 < bandwidth < np.inf:
            raise LimitError(f"bandwidth is {bandwidth}; must be positive")
        self.bandwidth = float(bandwidth)
        self.motion = MotionLimits(
            self.guarded_lower,
            self.guarded_upper,
            self.guarded_velocity,
            self.acceleration,
            self.bandwidth,
        )
        self.static_effort = (
            None
            if static_effort is None
            else StaticEffort(robot, self.effort, static_effort)
        )
        self.null_space_speed = (
            None
            if null_space_speed is None
            else _symmetric_limit(robot, null_space_speed, "null_space_speed", None)
        )
        if null_space_weight is not None and not 0.0 < null_space_weight < 1.0:
            raise LimitError(
                f"null_space_weight is {null_space_weight}; must be between 0 and 1"
            )
        self.null_space_weight = null_space_weight
        self.distances = tuple(distances)
        if any(each.proximity.robot is not robot for each in self.distances):
            raise LimitError("a minimum distance was built for another robot object")

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
        for each in self.distances:
            each.check_start(self.robot.state(0.0, q, v))
        fast = np.flatnonzero(np.abs(v) > self.velocity)
        if fast.size:
            i = fast[0]
            raise LimitError(
                f"the start is outside the limits: {names[i]} moves at {v[i]:.6g}, "
                f"its limit is {self.velocity[i]:.6g}"
            )


def _symmetric_limit(robot: Robot, value: Any, what: str, own: Array | None) -> Array:
    """Return a symmetric limit of shape (nv,), inf where there is none."""
    if value is None:
        return np.full(robot.nv, np.inf)
    if isinstance(value, str):
        _check_word(value, what, known=own is not None)
        limit = np.array(own, dtype=float)
        limit[list(robot.unactuated)] = np.inf
        # URDFs have 0 or the largest float where there is no limit.
        limit[(limit <= 0.0) | (limit >= np.finfo(np.float32).max)] = np.inf
        return limit
    limit = _array(robot, value, what)
    if not (limit > 0.0).all():
        raise LimitError(f"{what} limit is {limit.tolist()}; must be greater than 0")
    return limit


def _array(robot: Robot, value: Any, what: str) -> Array:
    try:
        array = np.array(value, dtype=float)
    except (TypeError, ValueError):
        raise LimitError(f"{what} is {value!r}; needs numbers") from None
    if array.ndim == 0:
        array = np.full(robot.nv, float(array))
    if array.shape != (robot.nv,):
        raise LimitError(
            f"{what} has shape {array.shape}; needs one number or {robot.nv}"
        )
    if np.isnan(array).any():
        raise LimitError(f"{what} contains NaN")
    return array


def _check_word(value: str, what: str, *, known: bool = True) -> None:
    if value != "robot" or not known:
        allowed = 'numbers, None or "robot"' if known else "numbers or None"
        raise LimitError(f"{what} is {value!r}; needs {allowed}")
