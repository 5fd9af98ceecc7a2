"""The conditions that end a motion, as pure functions, with their reasons.

The limits on a command are the "necessary conditions" of "Control Interface
Specification and Robot Limits", https://frankarobotics.github.io/docs. The measured
state is monitored with the limits of the arm's description.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError
from hsp_control.companions.franka.layouts import JOINTS, PERIOD, Error
from hsp_control.companions.franka_box.arm import (
    ACCELERATION,
    EFFORT_RATE,
    JERK,
    ArmLimits,
)
from hsp_control.companions.franka_box.hand import HandMotion
from hsp_control.geometry import Proximity, link_shapes, self_pairs
from hsp_control.robot import RobotState

LOST_IN_A_ROW = 20
"""Number of consecutive lost commands that end a motion ("Errors due to communication
problems", https://frankarobotics.github.io/docs/libfranka.html)."""


HAND_VELOCITY = np.array([3.0, 2.5])
"""Maximum speeds of a commanded hand, along and about an axis [m/s, rad/s]."""
HAND_ACCELERATION = np.array([9.0, 17.0])
"""Maximum accelerations of a commanded hand [m/s², rad/s²]."""
HAND_JERK = np.array([4500.0, 8500.0])
"""Maximum jerks of a commanded hand [m/s³, rad/s³]."""
ELBOW_VELOCITY = 1.5
"""Maximum speed of a commanded elbow [rad/s].

These four are Research 3's: libfranka 0.21, ``rate_limiting.h``.
"""
OF_JOINTS = (
    Error.JOINT_MOTION_GENERATOR_VELOCITY_LIMITS_VIOLATION,
    Error.JOINT_MOTION_GENERATOR_VELOCITY_DISCONTINUITY,
    Error.JOINT_MOTION_GENERATOR_ACCELERATION_DISCONTINUITY,
)
"""Errors of excessive velocities, accelerations and jerks of commanded joints."""
AFTER_INVERSE_KINEMATICS = (
    Error.CARTESIAN_MOTION_GENERATOR_JOINT_VELOCITY_LIMITS_VIOLATION,
    Error.CARTESIAN_MOTION_GENERATOR_JOINT_VELOCITY_DISCONTINUITY,
    Error.CARTESIAN_MOTION_GENERATOR_JOINT_ACCELERATION_DISCONTINUITY,
)
"""The same errors of joints that follow a commanded hand."""
_HAND_ERRORS = (
    Error.CARTESIAN_MOTION_GENERATOR_VELOCITY_LIMITS_VIOLATION,
    Error.CARTESIAN_MOTION_GENERATOR_VELOCITY_DISCONTINUITY,
    Error.CARTESIAN_MOTION_GENERATOR_ACCELERATION_DISCONTINUITY,
)


class Violation(NamedTuple):
    """An error, its cause and its remedy.

    Attributes:
        error: The error.
        reason: The joint, its value and its limit.
    """

    error: Error
    reason: str

    def __str__(self) -> str:
        return f"{self.error.spelling}: {self.reason}"


class Reference(NamedTuple):
    """A commanded motion, shapes (7,).

    Attributes:
        q: Position [rad].
        dq: Velocity [rad/s].
        ddq: Acceleration [rad/s²].
    """

    q: Array
    dq: Array
    ddq: Array


class ReflexThresholds(NamedTuple):
    """Thresholds of contacts and collisions.

    Attributes:
        lower_effort: Of a contact, shape (7,) [N·m].
        upper_effort: Of a collision, shape (7,) [N·m].
        lower_wrench: Of a contact, shape (6,) [N, N·m].
        upper_wrench: Of a collision, shape (6,) [N, N·m].
    """

    lower_effort: Array
    upper_effort: Array
    lower_wrench: Array
    upper_wrench: Array

    @classmethod
    def none(cls) -> "ReflexThresholds":
        """Return infinite thresholds."""
        joints, axes = np.full(JOINTS, np.inf), np.full(6, np.inf)
        return cls(joints, joints, axes, axes)


def measured(
    q: Array, dq: Array, tau_J: Array, limits: ArmLimits
) -> Iterator[Violation]:
    """Yield the violations of a measured state: positions, velocities, efforts."""
    lowest, highest = limits.velocities(q)
    yield from _outside(
        Error.JOINT_POSITION_LIMITS_VIOLATION, q, limits.lower, limits.upper, "rad"
    )
    yield from _outside(Error.JOINT_VELOCITY_VIOLATION, dq, lowest, highest, "rad/s")
    yield from _outside(
        Error.TAU_J_RANGE_VIOLATION, tau_J, -limits.effort, limits.effort, "N·m"
    )


def effort_rate(effort: Array, before: Array) -> Iterator[Violation]:
    """Yield a violation if a commanded effort changes too fast (backward Euler)."""
    limit = np.full(JOINTS, EFFORT_RATE)
    yield from _outside(
        Error.CONTROLLER_TORQUE_DISCONTINUITY,
        (effort - before) / PERIOD,
        -limit,
        limit,
        "N·m/s",
    )


def start_position(q: Array, at: Array, limits: ArmLimits) -> Iterator[Violation]:
    """Yield a violation if a motion starts out of range, or away from the arm."""
    yield from _position(q, limits)
    error = Error.JOINT_POSITION_MOTION_GENERATOR_START_POSE_INVALID
    lowest, highest = limits.velocities(at)
    yield from _outside(error, q - at, PERIOD * lowest, PERIOD * highest, "rad away")


def commanded_motion(
    new: Reference,
    before: Reference,
    limits: ArmLimits,
    errors: tuple[Error, Error, Error] = OF_JOINTS,
) -> Iterator[Violation]:
    """Yield the violations of a commanded motion; see `reference.to_position`."""
    yield from _position(new.q, limits)
    lowest, highest = limits.velocities(before.q)
    velocity, acceleration, jerk = errors
    yield from _outside(velocity, new.dq, lowest, highest, "rad/s commanded")
    limit = np.full(JOINTS, ACCELERATION)
    yield from _outside(acceleration, new.ddq, -limit, limit, "rad/s² commanded")
    limit, change = np.full(JOINTS, JERK), (new.ddq - before.ddq) / PERIOD
    yield from _outside(jerk, change, -limit, limit, "rad/s³ commanded")


def start_pose(way: HandMotion) -> Iterator[Violation]:
    """Yield a violation if a motion starts away from the hand."""
    error = Error.CARTESIAN_POSITION_MOTION_GENERATOR_START_POSE_INVALID
    yield from _of_hand(error, PERIOD * way.twist, PERIOD * HAND_VELOCITY, "away")


def commanded_hand(new: HandMotion, before: HandMotion) -> Iterator[Violation]:
    """Yield the violations of a commanded motion of the hand; see `hand.to_pose`."""
    change = (new.acceleration - before.acceleration) / PERIOD
    for error, values, limits, what in (
        (_HAND_ERRORS[0], new.twist, HAND_VELOCITY, "per s commanded"),
        (_HAND_ERRORS[1], new.acceleration, HAND_ACCELERATION, "per s² commanded"),
        (_HAND_ERRORS[2], change, HAND_JERK, "per s³ commanded"),
    ):
        yield from _of_hand(error, values, limits, what)


def commanded_elbow(
    speed: float, side: float, actual_side: float, *, first: bool
) -> Iterator[Violation]:
    """Yield a violation if a commanded elbow is on the other side, or too far away."""
    if side != actual_side:
        yield Violation(
            Error.CARTESIAN_MOTION_GENERATOR_ELBOW_SIGN_INCONSISTENT,
            f"flip direction {side:g} commanded; the arm's is {actual_side:g}",
        )
    if abs(speed) > ELBOW_VELOCITY:
        yield Violation(
            Error.CARTESIAN_MOTION_GENERATOR_START_ELBOW_INVALID
            if first
            else Error.CARTESIAN_MOTION_GENERATOR_ELBOW_LIMIT_VIOLATION,
            f"elbow at {speed:.6g} rad/s commanded; limit {ELBOW_VELOCITY:g}",
        )


def collisions(
    effort: Array, wrench: Array, thresholds: ReflexThresholds
) -> Iterator[Violation]:
    """Yield a violation if estimated external efforts are those of a collision."""
    upper = thresholds.upper_effort
    yield from _outside(
        Error.JOINT_REFLEX, effort, -upper, upper, "N·m of external effort"
    )
    upper = thresholds.upper_wrench
    yield from _outside(
        Error.CARTESIAN_REFLEX, wrench, -upper, upper, "N or N·m of external wrench",
        of="xyzRPY",
    )  # fmt: skip


def communication(lost: int) -> Iterator[Violation]:
    """Yield a violation if too many consecutive commands were lost."""
    if lost >= LOST_IN_A_ROW:
        yield Violation(
            Error.COMMUNICATION_CONSTRAINTS_VIOLATION,
            f"{lost} commands in a row were lost; limit {LOST_IN_A_ROW}",
        )


class LinkDistances:
    """The distances between the links of an arm that can collide.

    Attributes:
        unwatched: Lines on properties that are not monitored, with the reason.
    """

    def __init__(self, state: RobotState) -> None:
        """Monitor all pairs of links that are apart at a state."""
        robot = state.robot
        self.unwatched: list[str] = []
        self._proximity: Proximity | None = None
        try:
            shapes = link_shapes(robot)
        except ModelError as error:  # a mesh is missing; the other reflexes need none
            self.unwatched.append(f"self-collisions are not monitored: {error}")
            return
        pairs = self_pairs(robot, shapes)
        if not pairs:
            return
        distances = Proximity(robot, shapes, (), pairs).measure(state)
        apart = []
        for pair, distance in zip(pairs, distances, strict=True):
            if distance > 0.0:
                apart.append(pair)
                continue
            links = " and ".join(shapes[k].link for k in pair)
            self.unwatched.append(
                f"self-collision of {links} is not monitored: they overlap at the start"
            )
        if apart:
            self._proximity = Proximity(robot, shapes, (), apart)

    def nearest(self, state: RobotState) -> tuple[float, str]:
        """Return the smallest distance [m] and its pair of links."""
        return self._proximity.nearest(state) if self._proximity else (np.inf, "")


def self_collision(distance: float, links: str) -> Iterator[Violation]:
    """Yield a violation if links touch; see `LinkDistances.nearest`."""
    if distance < 0.0:
        yield Violation(
            Error.SELF_COLLISION_AVOIDANCE_VIOLATION,
            f"{links}, {-1e3 * distance:.1f} mm into each other",
        )


def _position(q: Array, limits: ArmLimits) -> Iterator[Violation]:
    """Yield a violation if a commanded position is out of range.

    The motion generators' own flag for it is always false since libfranka 0.15.
    """
    error = Error.JOINT_POSITION_LIMITS_VIOLATION
    yield from _outside(error, q, limits.lower, limits.upper, "rad commanded")


def _of_hand(
    error: Error, values: Array, limits: Array, what: str
) -> Iterator[Violation]:
    """Yield a violation if a norm along or about the axes, shape (6,), is too large."""
    norms = np.array([np.linalg.norm(values[:3]), np.linalg.norm(values[3:])])
    ways = ("translation", "rotation")
    yield from _outside(error, norms, -limits, limits, f"m or rad {what}", of=ways)


def _outside(
    error: Error,
    values: Array,
    lower: Array,
    upper: Array,
    unit: str,
    of: Sequence[str] = (),
) -> Iterator[Violation]:
    """Yield the value that is farthest outside its range, if one is."""
    excess = np.maximum(values - upper, lower - values)
    worst = int(np.argmax(excess))
    if excess[worst] > 0.0:
        value = values[worst]
        limit = upper[worst] if value > upper[worst] else lower[worst]
        name = of[worst] if of else f"joint {worst + 1}"
        yield Violation(error, f"{name} at {value:.6g} {unit}; limit {limit:.6g}")
