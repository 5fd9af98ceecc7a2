"""Checks at the start of a run, not in its steps."""

from collections.abc import Iterable

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ConfigurationError
from hsp_control.common.warned import warn
from hsp_control.constraints.limits import RobotLimits, in_degrees
from hsp_control.declaration.language import spoken
from hsp_control.declaration.nested import parts_within
from hsp_control.engine import Dynamics
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import FramePose, FramePosition, Task
from hsp_control.tasks.frame_position import axis_indices
from hsp_control.trajectories import Blend

REACHES = 2.0
"""Distance of a target from its frame, in units of the reach, above which it is a
mistake."""
MILLIMETRES = 100.0
"""The same above which it is in mm."""
JUMP = 0.1
"""Largest jump of the first effort relative to a joint's limit."""


REST = 0.05
"""Joint speed below which a robot is at rest, up to noise [rad/s or m/s]."""


class StartWarning(UserWarning):
    """A run would begin with a jump of an effort, or with too slow efforts.

    Or a task that a change adds begins without what is declared for all of them.
    """


def check_angles(robot: Robot, q: Array) -> None:
    """Check that no angle is so far beyond its joint's range that it is in degrees."""
    lower, upper = robot.position_limits()
    angles = robot.joint_positions(q)
    for name, unit, low, high, angle in zip(
        robot.dof_names, robot.units, lower, upper, angles, strict=True
    ):
        if in_degrees(unit, low, high, angle):
            raise ConfigurationError(
                f"joint {name!r} is at {angle:.6g} rad, but its range is from {low:g} "
                f"to {high:g} rad: degrees? Angles are in rad"
            )


def warn_of_far_targets(state: RobotState, tasks: Iterable[Task]) -> None:
    """Warn of targets that are so far away that the robot cannot be meant to go there.

    Looked at where a run begins: positions and poses of frames, at the end of the blend
    that leads to them, of a robot on a fixed base. A target that is set while it runs
    is looked at then; see `warn_of_far_target`.
    """
    for task in tasks:
        if isinstance(task, FramePose | FramePosition) and not task.remembers:
            blends = parts_within([task.followed], Blend)
            t = max([state.t, *(each.start_time + each.duration for each in blends)])
            if isinstance(task, FramePose):
                target = task.followed.sample(t).position.position
            else:
                target = task.trajectory.sample(t).position
            warn_of_far_target(state, task, target)


def warn_of_far_target(state: RobotState, task: Task, target: Array) -> None:
    """Warn if a target, shape (3,) or of the tracked axes [m], is far out of reach."""
    robot = state.robot
    if robot.unactuated or not isinstance(task, FramePose | FramePosition):
        return
    rows = np.arange(3)
    if isinstance(task, FramePosition):
        rows = axis_indices(task.axes)
    here, reach = state.position(task.frame_name)[rows], robot.size
    away = float(np.linalg.norm(target[: len(rows)] - here))
    if not reach or away <= REACHES * reach:
        return
    in_mm = away > MILLIMETRES * reach
    why = "millimetres? Lengths are in m" if in_mm else "it goes as near as it can"
    warn(
        f"the target of task {task.name!r} is {away:.4g} m away from "
        f"{task.frame_name!r}, but the robot reaches {reach:.2g} m: {why}",
        StartWarning,
    )


def warn_of_jump(
    robot: Robot, q: Array, v: Array, tau: Array, dynamics: Dynamics | None = None
) -> None:
    """Warn if the first effort is far from the one that held the robot before.

    A robot at rest is held against gravity, so there the effort jumps. That before a
    start in motion is unknown, and it is not checked: that of the paper's runs lies
    on the trajectory, with its velocity. Nor is a floating base, which contacts hold,
    nor a joint without an effort limit. ``dynamics``: with the payloads.
    """
    if robot.unactuated or (np.abs(v) > REST).any():
        return
    rest = np.zeros(robot.nv)
    gravity = robot.inverse_dynamics(q, rest, rest, dynamics)
    limit = robot.largest_efforts()
    share = np.abs(tau - gravity) / limit
    j = int(share.argmax())
    if not share[j] > JUMP:
        return
    unit = "N·m" if robot.units[j] == "rad" else "N"
    warn(
        f"the first effort of joint {robot.dof_names[j]!r} is {tau[j]:.3g} {unit}, but "
        f"gravity requires {gravity[j]:.3g} {unit}: a jump of {100.0 * share[j]:.0f} % "
        f"of its limit of {limit[j]:.3g} {unit}; let tasks begin gently with "
        f"{spoken('blend: 1.0', 'blend=1.0')}, or start on the trajectory with its "
        "velocity",
        StartWarning,
    )


def warn_of_slow_efforts(robot: Robot, q: Array, limits: RobotLimits | None) -> None:
    """Warn if gravity may change a joint's effort faster than its rate permits."""
    # A single joint rotating at its speed limit from the start has a sinusoidal gravity
    # effort. Floating bases are not checked.
    if limits is None or robot.unactuated:
        return
    rest, turn = np.zeros(robot.nv), 0.5 * np.pi * np.eye(robot.nv)
    here = robot.inverse_dynamics(q, rest, rest)
    worst, found = 1.0, ""
    for i, (name, unit) in enumerate(zip(robot.dof_names, robot.units, strict=True)):
        rate, speed = limits.effort_rate[i], limits.velocity[i]
        if unit != "rad" or not np.isfinite(rate + speed):
            continue
        there = robot.inverse_dynamics(robot.integrate(q, turn[i]), rest, rest)
        needed = speed * float(np.hypot(here[i], there[i]))
        if needed > worst * rate:
            worst = needed / rate
            found = (
                f"the effort of joint {name!r} may change by {rate:.3g} N·m/s, but "
                f"gravity by {needed:.3g} N·m/s at its speed limit of {speed:.3g} "
                "rad/s: the robot may fall, and pass its limits; give more "
                "limits.effort_rate, or less limits.velocity"
            )
    if found:
        warn(found, StartWarning)
