"""Whether the targets of a run can be reached, as far as they are known before it."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.constraints.contacts import Contact, PointContact, SurfaceContact
from hsp_control.constraints.limits import RobotLimits
from hsp_control.robot import Robot
from hsp_control.robot.inverse_kinematics import Target, reach
from hsp_control.tasks import FramePose, FramePosition, Task
from hsp_control.tasks.axes import axis_indices

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
    robot: Robot,
    tasks: Iterable[Task],
    q0: Array,
    duration: float,
    contacts: Sequence[Contact] = (),
    limits: RobotLimits | None = None,
) -> Iterator[OutOfReach]:
    """Yield the tasks whose targets leave the reach during a run.

    By inverse kinematics of each frame by itself, within position limits, for targets
    known before the run; of a robot with a floating base whose contacts stay where they
    are, whatever its balance asks.
    """
    held = _held(robot, contacts, q0)
    if robot.unactuated and not held:
        return
    box = robot.position_limits() if limits is None else (limits.lower, limits.upper)
    search = _Search(robot, q0, duration, held, *box)
    for task in tasks:
        if not isinstance(task, FramePose | FramePosition) or task.remembers:
            continue
        if isinstance(task, FramePosition):
            found = search.leaves(task, axis_indices(task.axes))
        elif (found := search.leaves(task, np.arange(6))) is not None:
            near = search.leaves(task, np.arange(3))
            found = found._replace(turned=True) if near is None else near
        if found is not None:
            yield found


def _held(robot: Robot, contacts: Sequence[Contact], q0: Array) -> list[Target]:
    """Return where contacts hold their frames; nothing if some move or end."""
    state, found = robot.state(0.0, q0, np.zeros(robot.nv)), []
    for contact in contacts:
        at_origin = isinstance(contact, PointContact) and not contact.points.any()
        if not contact.always or not (at_origin or isinstance(contact, SurfaceContact)):
            return []
        frame = state.frame(contact.frame)
        place = pin.SE3(frame.rotation.copy(), frame.position.copy())
        found.append(Target(contact.frame, place, contact.rows))
    return found


class _Search(NamedTuple):
    """Looks for postures in which a robot reaches its targets."""

    robot: Robot
    q0: Array
    duration: float  # of the run [s]
    held: Sequence[Target]  # what stays where it is
    lower: Array  # lower joint position limit, shape (nv,) [rad or m]
    upper: Array  # upper joint position limit, shape (nv,) [rad or m]

    def leaves(
        self, task: FramePose | FramePosition, rows: Indices
    ) -> OutOfReach | None:
        """Return when and by how much rows of a target are out of reach, if so."""
        times = self.duration * np.linspace(0.0, 1.0, _TIMES) ** _UNEVEN
        places = [target_of(task, t) for t in times]
        away: list[float] = []
        q = self.q0
        for k, place in enumerate(places):
            if k and place.isApprox(places[k - 1]):
                away.append(away[-1])
                continue
            # Once it is out of reach, the nearest place moves on with the target.
            starts = 0 if max(away, default=0.0) > _REACHED else _STARTS
            q, distance = self._nearest(Target(task.frame_name, place, rows), q, starts)
            away.append(distance)
        if max(away) <= _REACHED:
            return None
        first = next(k for k, distance in enumerate(away) if distance > _REACHED)
        worst = int(np.argmax(away))
        since, most = float(times[first]), float(times[worst])
        return OutOfReach(task.name, since, most, away[worst], turned=False)

    def _nearest(self, target: Target, q: Array, starts: int) -> tuple[Array, float]:
        """Return the posture nearest to a target, and its distance from it."""
        robot, neutral = self.robot, self.robot.neutral()
        lower, upper = self.lower, self.upper
        here, base = robot.difference(neutral, q), list(robot.unactuated)
        best = reach(robot, target, q, here, lower, upper, self.held)
        rng = np.random.default_rng(0)
        low, high = lower.clip(-np.pi, np.pi), upper.clip(-np.pi, np.pi)
        for start in rng.uniform(low, high, (starts, robot.nv)):
            if best.error <= _REACHED:
                break
            start[base] = here[base]
            q = robot.integrate(neutral, start)
            found = reach(robot, target, q, start, lower, upper, self.held)
            if found.error < best.error:
                best = found
        return best.q, best.error


def target_of(task: FramePose | FramePosition, t: float) -> pin.SE3:
    """Return where a task's frame is to be at a time [s]."""
    if isinstance(task, FramePose):
        pose = task.followed.sample(t)
        return pin.SE3(pose.orientation.rotation.copy(), pose.position.position.copy())
    place = pin.SE3.Identity()
    where = place.translation.copy()
    where[axis_indices(task.axes)] = task.trajectory.sample(t).position
    place.translation = where
    return place
