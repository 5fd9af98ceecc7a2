"""Joint speeds that references require, checked before a run."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.robot import Robot
from hsp_control.tasks import FramePose, FramePosition
from hsp_control.tasks.frame_position import axis_indices

_FAST = 1.01
"""Share of its largest speed above which a joint is too slow."""


class Passed(NamedTuple):
    """A posture in which a target is reached, or the nearest one found."""

    t: float  # the time [s]
    q: Array  # the configuration, shape (nq,)
    distance: float  # from the target [m and rad]


class TooFast(NamedTuple):
    """A task whose reference exceeds the speeds of joints."""

    task: str  # the task's name
    t: float  # the time at which it exceeds them most [s]
    speed: float  # of the reference then [m/s, or rad/s]
    unit: str
    share: float  # the speed that the joint needs over its limit
    joint: str

    @property
    def message(self) -> str:
        """The warning."""
        return (
            f"task {self.task!r}: its reference moves at {self.speed:.3g} {self.unit} "
            f"at t = {self.t:.3g} s, for which {self.joint!r} would need "
            f"{self.share:.3g} times its largest speed in a posture like that of the "
            f"start; {self.speed / self.share:.3g} {self.unit} would do there"
        )


def too_fast(
    robot: Robot,
    task: FramePose | FramePosition,
    passed: Sequence[Passed],
    limit: Array,
) -> TooFast | None:
    """Return where a reference is fastest, relative to the joints, if it is too fast.

    The least share max |v_i|/limit_i with which J v is the reference's rate, in each of
    the postures: one with another self-motion may need less.

    Args:
        robot: A robot whose base does not move.
        task: The task.
        passed: Postures along its reference.
        limit: Largest speed of each joint, shape (nv,) [rad/s or m/s]; inf: none.
    """
    worst: TooFast | None = None
    for t, q, _ in passed:
        rate, rows = _rate(task, t)
        share, joint = _share(robot, task.frame_name, q, rate, rows, limit)
        if share > max(_FAST, worst.share if worst else 0.0):
            linear = float(np.linalg.norm(rate[rows < 3]))
            speed = linear or float(np.linalg.norm(rate))
            unit = "m/s" if linear else "rad/s"
            name = robot.dof_names[joint]
            worst = TooFast(task.name, t, speed, unit, share, name)
    return worst


def _rate(task: FramePose | FramePosition, t: float) -> tuple[Array, Indices]:
    """Return the reference's rate, and which rows of the frame's velocity it is of."""
    if isinstance(task, FramePosition):
        return task.trajectory.sample(t).velocity, axis_indices(task.axes)
    pose = task.followed.sample(t)
    rates = [pose.position.velocity, pose.orientation.angular_velocity]
    return np.concatenate(rates), np.arange(6)


def _share(
    robot: Robot, frame: str, q: Array, rate: Array, rows: Indices, limit: Array
) -> tuple[float, int]:
    """Return the least share of their largest speeds, and the joint that has it."""
    J = robot.state(0.0, q, np.zeros(robot.nv)).frame(frame).jacobian[rows]
    # A joint without a limit is much faster than those with one, but not so much that
    # `rcond` would take these for locked.
    known = limit[np.isfinite(limit)]
    if not known.size:
        return 0.0, 0
    limited = np.where(np.isfinite(limit), limit, 1e4 * known.max())
    scaled = J * limited  # of shares v/limit
    least = np.linalg.pinv(scaled, rcond=1e-9) @ rate
    if np.linalg.norm(scaled @ least - rate) > 1e-6 * np.linalg.norm(rate):
        return 0.0, 0  # singular: reported elsewhere
    if np.abs(least).max() <= _FAST:
        return float(np.abs(least).max()), int(np.abs(least).argmax())
    from scipy.optimize import linprog  # here: importing SciPy is slow

    n = robot.nv
    sides = np.vstack([np.eye(n), -np.eye(n)])
    found = linprog(
        np.eye(n + 1)[-1],
        np.hstack([sides, -np.ones((2 * n, 1))]),
        np.zeros(2 * n),
        np.hstack([scaled, np.zeros((len(rows), 1))]),
        rate,
        [(None, None)] * n + [(0.0, None)],
    )
    shares = np.abs(least) if found.x is None else np.abs(found.x[:n])
    return float(shares.max()), int(shares.argmax())
