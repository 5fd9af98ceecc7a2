"""The conditions that end a motion, as pure functions, with their reasons.

The limits on a command are the "necessary conditions" of "Control Interface
Specification and Robot Limits", https://frankarobotics.github.io/docs. The measured
state is watched with the limits of the arm's description.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ModelError
from hsp_control.franka_box.arm import ACCELERATION, EFFORT_RATE, JERK, ArmLimits
from hsp_control.franka_box.wire import JOINTS, PERIOD, Error
from hsp_control.geometry import Proximity, link_shapes, self_pairs
from hsp_control.robot import RobotState

LOST_IN_A_ROW = 20
"""So many lost commands in a row end a motion ("Errors due to communication problems",
https://frankarobotics.github.io/docs/libfranka.html)."""


class Violation(NamedTuple):
    """An error, and what a user wants to know about it.

    Attributes:
        error: The error.
        reason: Which joint, its value and its limit.
    """

    error: Error
    reason: str

    def __str__(self) -> str:
        return f"{self.error.spelling}: {self.reason}"


class Reference(NamedTuple):
    """A commanded motion, shape (7,) each.

    Attributes:
        q: Position [rad].
        dq: Velocity [rad/s].
        ddq: Acceleration [rad/s²].
    """

    q: Array
    dq: Array
    ddq: Array


class Thresholds(NamedTuple):
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
    def none(cls) -> "Thresholds":
        """Return thresholds that nothing reaches."""
        joints, axes = np.full(JOINTS, np.inf), np.full(6, np.inf)
        return cls(joints, joints, axes, axes)


def measured(
    q: Array, dq: Array, tau_J: Array, limits: ArmLimits
) -> Iterator[Violation]:
    """Yield what a measured state violates: positions, velocities, efforts.

    Args:
        q: Positions, shape (7,) [rad].
        dq: Velocities, shape (7,) [rad/s].
        tau_J: Efforts with gravity, shape (7,) [N·m].
        limits: The arm's.
    """
    lowest, highest = limits.velocities(q)
    yield from _outside(
        Error.JOINT_POSITION_LIMITS_VIOLATION, q, limits.lower, limits.upper, "rad"
    )
    yield from _outside(Error.JOINT_VELOCITY_VIOLATION, dq, lowest, highest, "rad/s")
    yield from _outside(
        Error.TAU_J_RANGE_VIOLATION, tau_J, -limits.effort, limits.effort, "N·m"
    )


def effort_rate(effort: Array, before: Array) -> Iterator[Violation]:
    """Yield whether a commanded effort changes too fast (backward Euler).

    Args:
        effort: The new effort, shape (7,) [N·m].
        before: The last one as its client was told it, in single precision.
    """
    limit = np.full(JOINTS, EFFORT_RATE)
    yield from _outside(
        Error.CONTROLLER_TORQUE_DISCONTINUITY,
        (effort - before) / PERIOD,
        -limit,
        limit,
        "N·m/s",
    )


def commanded_motion(
    new: Reference, before: Reference, limits: ArmLimits, *, first: bool
) -> Iterator[Violation]:
    """Yield what a commanded motion violates; see `reference.following`.

    A position out of range is a ``joint_position_limits_violation``: the motion
    generator's own flag is always false since libfranka 0.15.

    Args:
        new: The commanded motion.
        before: The one a period before.
        limits: The arm's.
        first: Whether the motion begins; then a jump is a wrong start.
    """
    yield from _outside(
        Error.JOINT_POSITION_LIMITS_VIOLATION, new.q, limits.lower, limits.upper,
        "rad commanded",
    )  # fmt: skip
    lowest, highest = limits.velocities(before.q)
    too_fast = (
        Error.JOINT_POSITION_MOTION_GENERATOR_START_POSE_INVALID
        if first
        else Error.JOINT_MOTION_GENERATOR_VELOCITY_LIMITS_VIOLATION
    )
    yield from _outside(too_fast, new.dq, lowest, highest, "rad/s commanded")
    limit = np.full(JOINTS, ACCELERATION)
    yield from _outside(
        Error.JOINT_MOTION_GENERATOR_VELOCITY_DISCONTINUITY,
        new.ddq, -limit, limit, "rad/s² commanded",
    )  # fmt: skip
    limit = np.full(JOINTS, JERK)
    yield from _outside(
        Error.JOINT_MOTION_GENERATOR_ACCELERATION_DISCONTINUITY,
        (new.ddq - before.ddq) / PERIOD, -limit, limit, "rad/s³ commanded",
    )  # fmt: skip


def collisions(
    effort: Array, wrench: Array, thresholds: Thresholds
) -> Iterator[Violation]:
    """Yield whether estimated external efforts are those of a collision.

    Args:
        effort: Shape (7,) [N·m].
        wrench: In the base's axes, shape (6,) [N, N·m].
        thresholds: What the client has set.
    """
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
    """Yield whether too many commands in a row were lost."""
    if lost >= LOST_IN_A_ROW:
        yield Violation(
            Error.COMMUNICATION_CONSTRAINTS_VIOLATION,
            f"{lost} commands in a row were lost; limit {LOST_IN_A_ROW}",
        )


class SelfDistance:
    """The distances between the links of an arm that can collide.

    Attributes:
        unwatched: What is not watched, and why, a line each.
    """

    def __init__(self, state: RobotState) -> None:
        """Watch all pairs of links that are apart at a state."""
        robot = state.robot
        self.unwatched: list[str] = []
        self._proximity: Proximity | None = None
        try:
            shapes = link_shapes(robot)
        except ModelError as error:  # a mesh is missing; the other reflexes need none
            self.unwatched.append(f"no self-collision is watched: {error}")
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
                f"self-collision of {links} is not watched: they overlap at the start"
            )
        if apart:
            self._proximity = Proximity(robot, shapes, (), apart)

    def nearest(self, state: RobotState) -> tuple[float, str]:
        """Return the smallest distance [m], and between which links."""
        return self._proximity.nearest(state) if self._proximity else (np.inf, "")


def self_collision(distance: float, links: str) -> Iterator[Violation]:
    """Yield whether links touch; see `SelfDistance.nearest`."""
    if distance < 0.0:
        yield Violation(
            Error.SELF_COLLISION_AVOIDANCE_VIOLATION,
            f"{links}, {-1e3 * distance:.1f} mm into each other",
        )


def _outside(
    error: Error,
    values: Array,
    lower: Array,
    upper: Array,
    unit: str,
    of: str = "",
) -> Iterator[Violation]:
    """Yield the value that is farthest outside its range, if one is.

    Args:
        error: What it is called.
        values: Shape (n,).
        lower: Smallest values, shape (n,).
        upper: Largest values, shape (n,).
        unit: Unit of the values, and what they are.
        of: A letter for each value; by default they are numbered as joints.
    """
    excess = np.maximum(values - upper, lower - values)
    worst = int(np.argmax(excess))
    if excess[worst] > 0.0:
        value = values[worst]
        limit = upper[worst] if value > upper[worst] else lower[worst]
        name = of[worst] if of else f"joint {worst + 1}"
        yield Violation(error, f"{name} at {value:.6g} {unit}; limit {limit:.6g}")
