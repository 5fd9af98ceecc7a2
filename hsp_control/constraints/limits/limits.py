"""What a robot's motors and joints allow: efforts, their rate, and joint motion."""

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.constraints.limits.minimum_distance import MinimumDistance
from hsp_control.constraints.limits.static_effort import StaticEffort
from hsp_control.robot import Robot

Default = Literal["robot"]
"""The robot's own limit, as its URDF gives it."""


class Limits:
    """Box limits on effort and joint motion, which the controller then keeps.

    Efforts and their rate are hard. Position, velocity and acceleration become bounds
    on the acceleration, by barriers that let a limit be approached and not crossed,
    however near it is (an exponential control barrier function of bandwidth α):

        position        a ≤ α²(q_max - q) - 2α v
        velocity        a ≤ 2α (v_max - v)
        acceleration    a ≤ a_max

    and alike from below, the velocity's four times as steep within its margin.
    Distances have barriers of their own, see `MinimumDistance`, and so have postures
    that motors can hold, see `StaticEffort`. Where limits contradict each other, these
    yield first, acceleration yields to velocity, velocity to position, position to
    distance, and all of them to the effort.

    Where a limit binds the null space gives way first, and then the tasks. How far the
    null space gives way before the tasks do is bounded, if `null_space_speed` is given:
    with δ the deviation from the law's acceleration, s this speed and λ the rate of
    K_N, |(P δ)_j| ≤ λ s_j. Then e_N' = -K_N e_N - P δ stays a stable system with a
    bounded input, and ‖e_N‖_W ≤ ‖s‖_|W| for ever (docs/limits.md). Of all bounds it is
    the first to give way.

    Attributes:
        robot: The robot.
        effort: Greatest effort, shape (nv,) [N·m or N]; inf where unlimited.
        effort_rate: Greatest rate of effort, shape (nv,) [N·m/s or N/s].
        velocity: Greatest speed, shape (nv,) [rad/s or m/s].
        acceleration: Greatest acceleration, shape (nv,) [rad/s² or m/s²].
        lower: Least joint position, shape (nv,) [rad or m]; -inf where unlimited.
        upper: Greatest joint position, shape (nv,) [rad or m].
        guarded_velocity: The speed that the barriers keep, within its margin.
        guarded_lower: The position that the barriers keep, within its margin.
        guarded_upper: The position that the barriers keep, within its margin.
        bandwidth: α of the barriers [1/s].
        distances: What must keep how far apart.
        static_effort: What keeps postures to those that motors can hold, if anything.
        null_space_speed: s, shape (nv,) [rad/s or m/s]; None: no bound.
        null_space_weight: What null-space motion costs beside the first task, where
            limits bind; None: as little as rounding permits.
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
        """Set the limits; each is a number, one per freedom, or None for no limit.

        Args:
            robot: The robot.
            effort: Greatest effort [N·m or N]; "robot": the URDF's.
            effort_rate: Greatest rate of effort [N·m/s]; a Panda's is 1000.
            velocity: Greatest speed [rad/s or m/s]; "robot": the URDF's.
            acceleration: Greatest acceleration [rad/s² or m/s²].
            position: (lower, upper) joint positions [rad or m]; "robot": the URDF's.
            position_margin: How far inside its limits a position is kept [rad or m]:
                with efforts held for a period a barrier lets the motion reach the
                acceleration's error over α² beyond it.
            velocity_margin: How far inside its limits a speed is kept, as a part of it.
            distances: What must keep how far apart.
            bandwidth: α [1/s]. 5 to 20 is what a motor follows: faster barriers ask at
                the last moment for more than the effort's rate can give.
            static_effort: The part of an effort that gravity may take; for motors that
                bear no contact. None: any.
            null_space_speed: s [rad/s or m/s]: how fast the null space may leave the
                field, before tasks give way.
            null_space_weight: What null-space motion costs beside the first task,
                between 0 and 1. None: 1e-6, and 1e-8 where tasks have priorities. 1e-3
                brings to rest a robot that cannot reach its target, at 1e-3 of the
                null space's deviation in the task's.

        Raises:
            LimitError: If a limit is not positive, lower is not below upper, or the
                shape is not the robot's.
        """
        self.robot = robot
        nv = robot.nv
        self.effort = _greatest(robot, effort, "effort", robot.model.effortLimit)
        self.velocity = _greatest(
            robot, velocity, "velocity", robot.model.velocityLimit
        )
        if not 0.0 <= velocity_margin < 1.0:
            raise LimitError(
                f"velocity_margin is {velocity_margin}; must be at least 0, and below 1"
            )
        self.guarded_velocity = (1.0 - velocity_margin) * self.velocity
        self.effort_rate = _greatest(robot, effort_rate, "effort_rate", None)
        self.acceleration = _greatest(robot, acceleration, "acceleration", None)
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
                "position limits on a joint without a coordinate of its own (a root, "
                "or a continuous joint); leave them infinite"
            )
        if not 0.0 < bandwidth < np.inf:
            raise LimitError(f"bandwidth is {bandwidth}; must be positive")
        self.bandwidth = float(bandwidth)
        self.static_effort = (
            None
            if static_effort is None
            else StaticEffort(robot, self.effort, static_effort)
        )
        self.null_space_speed = (
            None
            if null_space_speed is None
            else _greatest(robot, null_space_speed, "null_space_speed", None)
        )
        if null_space_weight is not None and not 0.0 < null_space_weight < 1.0:
            raise LimitError(
                f"null_space_weight is {null_space_weight}; must be between 0 and 1"
            )
        self.null_space_weight = null_space_weight
        self.distances = tuple(distances)
        if any(each.proximity.robot is not robot for each in self.distances):
            raise LimitError("a least distance was built for another robot object")

    def check_start(self, q: Array, v: Array) -> None:
        """Refuse a start outside the limits; distances are at t = 0.

        Args:
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).

        Raises:
            LimitError: Names the joint, its position or speed, and the limit.
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


def _greatest(robot: Robot, value: Any, what: str, own: Array | None) -> Array:
    """Return a symmetric limit of shape (nv,), inf where there is none."""
    if value is None:
        return np.full(robot.nv, np.inf)
    if isinstance(value, str):
        _check_word(value, what, known=own is not None)
        limit = np.array(own, dtype=float)
        limit[list(robot.unactuated)] = np.inf
        # URDFs write 0, or the largest number there is, where they know no limit.
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
        raise LimitError(f"{what} holds a NaN")
    return array


def _check_word(value: str, what: str, *, known: bool = True) -> None:
    if value != "robot" or not known:
        allowed = 'numbers, None or "robot"' if known else "numbers or None"
        raise LimitError(f"{what} is {value!r}; needs {allowed}")
