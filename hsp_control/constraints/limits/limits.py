"""Limits of a robot: their declaration, and their numbers for one robot."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Annotated, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator

from hsp_control.common.arrays import Array
from hsp_control.common.errors import LimitError
from hsp_control.constraints.limits.acceleration_bounds import MotionLimits
from hsp_control.constraints.limits.barriers import Barrier, StaticEffort
from hsp_control.constraints.limits.joint_numbers import (
    Maximum,
    PositionRange,
    PositionsByJoint,
    Positives,
    by_dof,
    maximum,
    none_for_nothing,
    own_speeds,
)
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import (
    ArrayField,
    Fraction,
    NonNegative,
    Positive,
    Share,
    read_only,
)
from hsp_control.geometry.scene import Scene, Start
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
        motion: The limits that the barriers enforce: position and velocity limits less
            their margins, the maximum acceleration and α, as a record for calls.
        barriers: Minimum distances, and other barriers.
        static_effort: The limit on the effort against gravity, if any.
    """

    robot: Robot
    effort: Array
    effort_rate: Array
    velocity: Array
    lower: Array
    upper: Array
    motion: MotionLimits
    barriers: tuple[Barrier, ...] = ()
    static_effort: StaticEffort | None = None

    @property
    def acceleration(self) -> Array:
        """Maximum acceleration, shape (nv,) [rad/s² or m/s²]."""
        return self.motion.acceleration

    @property
    def bandwidth(self) -> float:
        """α of the barriers [1/s]."""
        return float(self.motion.bandwidth[0])

    def check_start(self, q: Array, v: Array) -> None:
        """Check that a start is within the limits; barriers are those at t = 0."""
        names = self.robot.dof_names
        positions = self.robot.joint_positions(q)
        outside = np.flatnonzero((positions < self.lower) | (positions > self.upper))
        if outside.size:
            i, hint = outside[0], ""
            if in_degrees(
                self.robot.units[i], self.lower[i], self.upper[i], positions[i]
            ):
                hint = ": degrees? Angles are in rad"
            raise LimitError(
                f"the start is outside the limits: {names[i]} is at {positions[i]:.6g},"
                f" its limits are {self.lower[i]:.6g} to {self.upper[i]:.6g}{hint}"
            )
        state = self.robot.state(0.0, q, v)
        for each in self.barriers:
            each.check_start(state)
        fast = np.flatnonzero(np.abs(v) > self.velocity)
        if fast.size:
            i = fast[0]
            raise LimitError(
                f"the start is outside the limits: {names[i]} moves at {v[i]:.6g}, "
                f"its limit is {self.velocity[i]:.6g}"
            )


_FAR = 2.0
"""Distance from the middle of a joint's range, in ranges, beyond which an angle is not
in rad."""
_NEAR = 1.0
"""Minimum distance of an angle in degrees from the middle of the range [rad]."""


def in_degrees(unit: str, lower: float, upper: float, position: float) -> bool:
    """Return whether a joint's position is far enough from its range to be in degrees.

    Continuous and sliding joints are not checked.
    """
    if unit != "rad" or not np.isfinite(upper - lower):
        return False
    away = abs(position - 0.5 * (lower + upper))
    return bool(away > max(_FAR * (upper - lower), _NEAR))


BANDWIDTH = 10.0
"""Default α of the barriers [1/s]."""

_HELD = 0.95
"""Part of a motor's effort that gravity may use by default: the rest brakes the arm."""


class Limits(Part, error=LimitError):
    """Limits on effort, joint motion and barriers, which the controller enforces.

    The limits on efforts and their rate are hard. Those on position, velocity and
    acceleration become bounds on the acceleration, by barriers that let the robot
    approach a limit but not cross it (exponential control barrier functions of
    bandwidth α):

        position        a ≤ α²(q_max - q) - 2α v
        velocity        a ≤ 2α (v_max - v), and a ≤ √(j (v_max - v))
        acceleration    a ≤ a_max

    and likewise from below; the velocity barrier is four times as steep within its
    margin. j is the largest rate of the acceleration at the effort's rate. Distances
    and the effort against gravity have their own barriers. Where limits contradict each
    other they are relaxed in this order: static effort, acceleration, velocity,
    position, barriers. Effort limits are never relaxed.

    Where a limit is active, the null space deviates from the law first, and then the
    tasks, the lowest priority first.

    "robot" is the robot's own limit, from its URDF, and "none" is no limit. Numbers are
    one for all joints, or nv, with None where there is no limit.
    """

    _: KW_ONLY
    effort: Maximum = "robot"
    """Maximum effort [N·m or N]: the robot's own, none, a factor, numbers by joint, one
    number or nv."""
    effort_rate: Maximum = "robot"
    """Maximum rate of the effort [N·m/s or N/s]: the robot's own, none, a factor,
    numbers by joint, one number or nv. URDFs do not contain it: the robot's own is 11
    times the largest of its maximum efforts per second: for a Panda 957 N·m/s, or 0.96
    N·m per millisecond. With a floating base, whose contacts change, it is 500
    times."""
    velocity: Maximum = "robot"
    """Maximum speed [rad/s or m/s]: the robot's own, none, a factor, numbers by joint,
    one number or nv. A joint without one has the largest of the others."""
    acceleration: Positives | None = None
    """Maximum acceleration [rad/s² or m/s²], one number or nv. Unlimited by default."""
    position: Annotated[
        Literal["robot", "none"] | PositionRange | PositionsByJoint | None,
        BeforeValidator(none_for_nothing),
    ] = "robot"
    """Joint position limits [rad or m]: the robot's own, none, numbers for some joints,
    or numbers."""
    position_margin: NonNegative | None = None
    """Margin inside the position limits [rad or m]: 0.005 by default, at most a tenth
    of a joint's range. A barrier may be crossed by an error of the acceleration over
    α², but not by its recent mean, once `Controller.applied` reports the period."""
    velocity_margin: Share = 0.02
    """Margin inside the speed limits, as a fraction of the limit [-]."""
    barriers: Annotated[Sequence[Barrier], AfterValidator(tuple)] = ()
    """Minimum distances, and other functions of the posture with a minimum [-]."""
    bandwidth: Positive | None = None
    """Bandwidth α of the barriers [1/s]: 10 by default, or as a plan requires. Motors
    can follow 5 to 20: faster barriers act so late that they exceed the effort rate. A
    joint at rest may accelerate by α² times its distance from the limit."""
    static_effort: Annotated[
        Literal["robot", "none"] | Fraction | None, BeforeValidator(none_for_nothing)
    ] = "robot"
    """Fraction of the effort limit that gravity may use [-], so that an arm stays in
    postures in which its motors can hold it; for motors without contact forces. By
    default 0.95 for an arm on which gravity may exceed a motor's effort; none where the
    base floats."""

    def placed(self, start: Start) -> RobotLimits:
        """Return the limits in numbers, for one robot and one scene."""
        robot = start.state.robot
        with within("effort"):
            effort = maximum(self.effort, robot.model.effortLimit, robot)
        with within("velocity"):
            velocity = maximum(self.velocity, own_speeds(robot), robot)
        with within("position"):
            lower, upper, margin = self._positions(robot)
        barriers = []
        for k, each in enumerate(self.barriers):
            with within("barriers", k):
                barriers.append(each.placed(start))
        with within("effort_rate"):
            effort_rate = maximum(self.effort_rate, robot.effort_rate, robot)
        return RobotLimits(
            robot=robot,
            effort=read_only(effort),
            effort_rate=read_only(effort_rate),
            velocity=read_only(velocity),
            lower=read_only(lower),
            upper=read_only(upper),
            motion=MotionLimits(
                read_only(lower + margin),
                read_only(upper - margin),
                read_only((1.0 - self.velocity_margin) * velocity),
                self._numbers("acceleration", robot),
                read_only(effort_rate / robot.largest_inertias),
                read_only([BANDWIDTH if self.bandwidth is None else self.bandwidth]),
            ),
            barriers=tuple(barriers),
            static_effort=self._static_effort(robot, effort),
        )

    def _static_effort(self, robot: Robot, effort: Array) -> StaticEffort | None:
        share = self.static_effort
        if share == "robot":
            effort = np.where(robot.largest_gravity > effort, effort, np.inf)
            if robot.unactuated or not np.isfinite(effort).any():
                return None
            share = _HELD
        if share is None or isinstance(share, str):
            return None
        return StaticEffort(read_only(effort), share)

    def _numbers(self, field: str, robot: Robot) -> Array:
        """Return the numbers of a field, shape (nv,); inf where there is no limit."""
        with within(field):
            return read_only(by_dof(getattr(self, field), robot.nv))

    def _positions(self, robot: Robot) -> tuple[Array, Array, Array]:
        """Return lower and upper joint positions and their margin, shape (nv,)."""
        if isinstance(self.position, PositionRange | PositionsByJoint):
            lower, upper = self.position.of(robot)
        elif self.position == "robot":
            lower, upper = robot.position_limits()
        else:
            lower, upper = np.full(robot.nv, -np.inf), np.full(robot.nv, np.inf)
        margin = np.full(robot.nv, self.position_margin or 0.0)
        if self.position_margin is None:
            margin[:] = np.minimum(0.005, 0.1 * (upper - lower))
        crossed = np.flatnonzero(~(lower + margin < upper - margin))
        if crossed.size:
            i = crossed[0]
            raise LimitError(
                f"the limits of {robot.dof_names[i]} leave no room: {lower[i]:.6g} to "
                f"{upper[i]:.6g} with a margin of {margin[i]:g}; give a smaller "
                "position_margin, or position: none"
            )
        return lower, upper, margin


LimitsOrNone = Annotated[
    Limits | None,
    ArrayField(
        Limits | Literal["none"] | None,
        lambda limits: None if limits == "none" else limits,
        none="none",
    ),
]
"""Limits, or None: in YAML the word none."""


def own_limits(robot: Robot) -> RobotLimits:
    """Return the limits of the robot's URDF, in numbers."""
    state = robot.state(0.0, robot.home(), np.zeros(robot.nv))
    return Limits().placed(Start(state, Scene()))
