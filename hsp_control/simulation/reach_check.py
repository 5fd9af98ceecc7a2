"""Whether the targets of a run can be reached, as far as they are known before it."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.inverse_kinematics import Target, reach
from hsp_control.tasks import FramePose, FramePosition, Task

_TIMES = 40
"""At how many times of a run a target is looked at."""
_UNEVEN = 1.1
"""The times are powers of even ones, so that a target that goes round in a whole part
of the run is not looked at in one place alone."""
_STARTS = 4
"""From how many random postures inverse kinematics begins where it failed."""
_REACHED = 1e-3
"""Distance at which a target is reached [m and rad]."""


class OutOfReach(NamedTuple):
    """A task whose target leaves the reach of its frame."""

    task: str  # the task's name
    first: float  # the first time at which it is out of reach [s]
    worst: float  # the time at which it is farthest [s]
    distance: float  # how far from the nearest place it is then [m]
    turned: bool  # whether the position alone could be reached

    @property
    def message(self) -> str:
        """What a user should know."""
        when = f"from t = {self.first:.3g} s"
        if self.first == self.worst == 0.0:
            when = "at the start"
        elif self.worst > self.first:
            when += f", most at {self.worst:.3g} s"
        if self.turned:
            return (
                f"task {self.task!r}: its target cannot be reached in its orientation, "
                f"{when}: the hand goes as near as it can"
            )
        return (
            f"task {self.task!r}: its target is out of reach by {self.distance:.2g} m, "
            f"{when}: the hand goes as near as it can"
        )


def out_of_reach(
    robot: Robot, tasks: Iterable[Task], q0: Array, duration: float
) -> Iterator[OutOfReach]:
    """Yield the tasks whose targets leave the reach during a run.

    By inverse kinematics of each frame by itself, within position limits: of robots
    with a fixed base and single-dof joints, and targets known before the run.
    """
    if robot.unactuated or robot.nq != robot.nv:
        return
    for task in tasks:
        whole = isinstance(task, FramePose)
        tracked = whole or (isinstance(task, FramePosition) and task.axes == "xyz")
        if not tracked or task.remembers:
            continue
        found = _leaves(robot, task, q0, duration, 6 if whole else 3)
        if found is not None and whole:
            near = _leaves(robot, task, q0, duration, 3)
            found = found._replace(turned=True) if near is None else near
        if found is not None:
            yield found


def _leaves(
    robot: Robot, task: Task, q0: Array, duration: float, rows: int
) -> OutOfReach | None:
    """Return when and by how much the target of a task is out of reach, if it is."""
    times = duration * np.linspace(0.0, 1.0, _TIMES) ** _UNEVEN
    places = [(t, _target(task, t)) for t in times]
    away: list[float] = []
    q = q0
    for k, (_, place) in enumerate(places):
        if k and place.isApprox(places[k - 1][1]):
            away.append(away[-1])
            continue
        assert isinstance(task, FramePose | FramePosition)
        # Once it is out of reach, the nearest place moves on with the target.
        starts = 0 if max(away, default=0.0) > _REACHED else _STARTS
        target = Target(task.frame_name, place, rows)
        q, distance = _nearest(robot, target, q, starts)
        away.append(distance)
    if max(away) <= _REACHED:
        return None
    first = next(k for k, distance in enumerate(away) if distance > _REACHED)
    worst = int(np.argmax(away))
    since, most = float(times[first]), float(times[worst])
    return OutOfReach(task.name, since, most, away[worst], turned=False)


def _target(task: Task, t: float) -> pin.SE3:
    """Return where a task's frame is to be at a time [s]."""
    if isinstance(task, FramePose):
        pose = task.followed.sample(t)
        return pin.SE3(pose.orientation.rotation.copy(), pose.position.position.copy())
    assert isinstance(task, FramePosition)
    return pin.SE3(np.eye(3), task.trajectory.sample(t).position.copy())


def _nearest(
    robot: Robot, target: Target, q: Array, starts: int
) -> tuple[Array, float]:
    """Return the posture nearest to a target, and its distance from it."""
    lower, upper = robot.position_limits()
    best = reach(robot, target, q, q, lower, upper)
    rng = np.random.default_rng(0)
    low, high = lower.clip(-np.pi, np.pi), upper.clip(-np.pi, np.pi)
    for start in rng.uniform(low, high, (starts, robot.nv)):
        if best.error <= _REACHED:
            break
        found = reach(robot, target, start, start, lower, upper)
        if found.error < best.error:
            best = found
    return best.q, best.error
