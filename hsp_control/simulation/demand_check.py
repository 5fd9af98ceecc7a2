"""Feasibility of targets and commanded forces, checked before a run."""

from collections.abc import Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.constraints.contacts import (
    Contact,
    PointContact,
    SlidingContact,
    SurfaceContact,
)
from hsp_control.constraints.limits import RobotLimits
from hsp_control.control import Controller
from hsp_control.control.actuation.support import Support
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.inverse_kinematics import Target, reach
from hsp_control.simulation.speed_check import Passed, TooFast, too_fast
from hsp_control.tasks import CenterOfMass, FramePose, FramePosition, Task
from hsp_control.tasks.frame_position import axis_indices

_TIMES = 40
"""Number of times of a run at which a target is checked."""
_UNEVEN = 1.1
"""The times are powers of even ones, so that a target whose cycle divides the run is
not checked in one place alone."""
_STARTS = 4
"""Number of random postures from which inverse kinematics is tried again."""
_REACHED = 1e-3
"""Distance at which a target is reached [m and rad]."""


class OutOfReach(NamedTuple):
    """A task whose target leaves the reach of its frame."""

    task: str  # the task's name
    first: float  # the first time at which it is out of reach [s]
    worst: float  # the time at which it is farthest [s]
    distance: float  # its distance from the nearest place then [m]
    turned: bool  # whether the position alone could be reached

    @property
    def message(self) -> str:
        """The warning."""
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


def not_followed(
    robot: Robot,
    tasks: Iterable[Task],
    q0: Array,
    duration: float,
    contacts: Sequence[Contact] = (),
    limits: RobotLimits | None = None,
) -> Iterator[OutOfReach | TooFast]:
    """Yield the tasks whose targets leave the reach, or are too fast, during a run.

    By inverse kinematics of each frame by itself, within position limits, for targets
    known before the run; of a robot with a floating base whose contacts do not move,
    regardless of its balance. Speeds are checked where the base does not move.
    """
    held = _held(robot, contacts, q0)
    if robot.unactuated and not held:
        return
    box = robot.position_limits() if limits is None else (limits.lower, limits.upper)
    search = _Search(robot, q0, duration, held, *box)
    for task in tasks:
        if not isinstance(task, FramePose | FramePosition) or task.remembers:
            continue
        rows = np.arange(6)
        if isinstance(task, FramePosition):
            rows = axis_indices(task.axes)
        passed = search.passed(task, rows)
        found = _leaves(task, passed)
        if found is not None and isinstance(task, FramePose):
            near = _leaves(task, search.passed(task, np.arange(3)))
            found = found._replace(turned=True) if near is None else near
        if found is not None:
            yield found
        elif limits is not None and not robot.unactuated:
            fast = too_fast(robot, task, passed, limits.velocity)
            if fast is not None:
                yield fast


def _held(robot: Robot, contacts: Sequence[Contact], q0: Array) -> list[Target]:
    """Return the poses at which contacts hold frames; nothing if some move or end."""
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
    """Searches postures in which a robot reaches its targets."""

    robot: Robot
    q0: Array
    duration: float  # of the run [s]
    held: Sequence[Target]  # frames that do not move
    lower: Array  # lower joint position limit, shape (nv,) [rad or m]
    upper: Array  # upper joint position limit, shape (nv,) [rad or m]

    def passed(self, task: FramePose | FramePosition, rows: Indices) -> list[Passed]:
        """Return the postures nearest to rows of a target, during the run."""
        times = self.duration * np.linspace(0.0, 1.0, _TIMES) ** _UNEVEN
        places = [target_of(task, t) for t in times]
        found: list[Passed] = []
        q, distance, farthest = self.q0, 0.0, 0.0
        for k, (t, place) in enumerate(zip(times, places, strict=True)):
            if not (k and place.isApprox(places[k - 1])):
                # Once it is out of reach, the nearest place moves on with the target.
                starts = 0 if farthest > _REACHED else _STARTS
                target = Target(task.frame_name, place, rows)
                q, distance = self._nearest(target, q, starts)
                farthest = max(farthest, distance)
            found.append(Passed(float(t), q, distance))
        return found

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


def _leaves(
    task: FramePose | FramePosition, passed: Sequence[Passed]
) -> OutOfReach | None:
    """Return time and distance at which a target is out of reach, or None."""
    away = [each.distance for each in passed]
    if max(away) <= _REACHED:
        return None
    first = next(k for k, distance in enumerate(away) if distance > _REACHED)
    worst = int(np.argmax(away))
    since, most = passed[first].t, passed[worst].t
    return OutOfReach(task.name, since, most, away[worst], turned=False)


def target_of(task: FramePose | FramePosition, t: float) -> pin.SE3:
    """Return the desired placement of a task's frame at a time [s]."""
    if isinstance(task, FramePose):
        pose = task.followed.sample(t)
        return pin.SE3(pose.orientation.rotation.copy(), pose.position.position.copy())
    place = pin.SE3.Identity()
    where = place.translation.copy()
    where[axis_indices(task.axes)] = task.trajectory.sample(t).position
    place.translation = where
    return place


def too_weak(robot: Robot, q: Array, limits: Array) -> Iterator[tuple[str, str]]:
    """Yield the joints that cannot hold the robot at a configuration, with reasons."""
    rest = np.zeros(robot.nv)
    static = np.abs(robot.inverse_dynamics(q, rest, rest))
    for k in np.flatnonzero(static > limits):
        unit = "N·m" if robot.units[k] == "rad" else "N"
        yield (
            f"joint {robot.dof_names[k]!r}",
            f"gravity requires {static[k]:.3g} {unit} of it, its limit is "
            f"{limits[k]:.3g}",
        )


# --- commanded forces -----------------------------------------------------------------


_LOOKS = 41
"""Number of times of a run at which commands are checked."""
_KEPT = 0.99
"""Share of a command from which on it is kept."""


def missed_forces(
    controller: Controller, q0: Array, duration: float, push_off: float = 0.0
) -> Iterator[str]:
    """Yield warnings of commanded forces that will be missed.

    A force that is infeasible at rest, within efforts, friction and balance, in
    the posture of the start, with its centre of mass where a task moves it. And a slide
    that the plant's surface pushes off (`PlantPart.push_off`). ``controller`` is not
    changed.
    """
    if all(contact.force is None for contact in controller.contacts):
        return
    controller, rest = controller.preview(), np.zeros(controller.robot.nv)
    least: dict[str, tuple[float, str]] = {}  # share of a command and its warning
    for t in map(float, np.linspace(0.0, duration, _LOOKS)):
        controller.compute(t, q0, rest)  # the commands at that time
        support = controller.active_stack.support
        pressed = _pressed(support)
        share = _share(controller, support, t) if pressed else 1.0
        for contact in support.contacts:
            force, kept = pressed.get(contact.name, 0.0), share
            problem = (
                f"at most {kept * force:.3g} of {force:.3g} N are possible at rest, "
                "within efforts, friction and balance"
            )
            if isinstance(contact, SlidingContact) and contact.slides and push_off:
                speed = _slip(controller, contact, t)
                needed = speed * push_off * _mass(contact, controller.state)
                if force < kept * needed:
                    kept = force / needed
                    problem = (
                        f"it slides at {speed:.2g} m/s, and the plant's surface pushes "
                        f"it off below {needed:.3g} N; {force:.3g} N are commanded"
                    )
            if force > 0.0 and kept < least.get(contact.name, (_KEPT, ""))[0]:
                least[contact.name] = kept, f"at t = {t:.3g} s {problem}"
    for name, (_, message) in least.items():
        yield f"contact {name!r}: {message}"


def _pressed(support: Support) -> dict[str, float]:
    """Return the commanded normal forces [N] by contact."""
    return {
        contact.name: float(support.reference.reshape(-1, 3)[points, 2].sum())
        for contact, points in zip(support.contacts, support.points, strict=True)
        if contact.force is not None and support.reference.reshape(-1, 3)[points].any()
    }


def _share(controller: Controller, support: Support, t: float) -> float:
    """Return the largest share of the commands with which the robot can rest.

    A linear programme in the forces at the points and that share.
    """
    from scipy.optimize import linprog  # here: importing SciPy is slow

    state, robot, n = controller.state, controller.robot, support.size
    equal: list[Array] = []
    given: list[Array] = []
    if len(robot.unactuated) == 6:
        blocks = [
            np.vstack([contact.axes, pin.skew(support.positions[k]) @ contact.axes])
            for contact, points in zip(support.contacts, support.points, strict=True)
            for k in range(points.start, points.stop)
        ]
        weight = -pin.computeTotalMass(robot.model) * robot.model.gravity.linear
        center = _center(controller, state, t)
        equal.append(np.hstack([*blocks, np.zeros((6, 1))]))
        given.append(np.concatenate([weight, np.cross(center, weight)]))
    for contact, points in zip(support.contacts, support.points, strict=True):
        if contact.force is None:
            continue
        rows = np.eye(n, n + 1)[3 * points.start : 3 * points.stop]
        rows[:, -1] = -support.reference[3 * points.start : 3 * points.stop]
        free = contact.force.dimension == 1 and not contact.slides
        equal.append(rows[2::3] if free else rows)
        given.append(np.zeros(len(equal[-1])))
    # cones and the efforts N - F f, each above a lower bound
    limit, tau = np.full(robot.nv, np.inf), state.nonlinear_effects
    if controller.limits is not None:
        limit[:] = controller.limits.effort
    limit[list(robot.unactuated)] = np.inf
    rows = np.vstack([support.cone, support.map, -support.map])
    least = np.concatenate([np.zeros(len(support.cone)), tau - limit, -tau - limit])
    found = linprog(
        -np.eye(n + 1)[-1],
        -np.hstack([rows, np.zeros((len(rows), 1))])[np.isfinite(least)],
        -least[np.isfinite(least)],
        np.vstack(equal),
        np.concatenate(given),
        [*zip(support.lower, support.upper, strict=True), (0.0, 1.0)],
    )
    return 1.0 if found.x is None else float(found.x[-1])


def _center(controller: Controller, state: RobotState, t: float) -> Array:
    """Return the desired centre of mass, shape (3,) [m]."""
    center = state.centroidal.position.copy()
    for task in controller.tasks:
        if isinstance(task, CenterOfMass) and not task.remembers:
            center[axis_indices(task.axes)] = task.trajectory.sample(t).position
    return np.asarray(center)


def _slip(controller: Controller, contact: SlidingContact, t: float) -> float:
    """Return the speed at which tasks move a contact along its plane [m/s]."""
    speed, h, across = 0.0, 1e-4, contact.axes[:, :2].T
    for task in controller.tasks:
        if not isinstance(task, FramePose | FramePosition) or task.remembers:
            continue
        if task.frame_name == contact.frame:
            now, then = (
                target_of(task, t).translation,
                target_of(task, t + h).translation,
            )
            speed = max(speed, float(np.linalg.norm(across @ (then - now))) / h)
    return speed


def _mass(contact: SlidingContact, state: RobotState) -> float:
    """Return the effective mass of a contact's frame along the normal [kg]."""
    row = contact.axes[:, 2] @ state.frame(contact.frame).jacobian[:3]
    return 1.0 / float(row @ np.linalg.solve(state.mass_matrix, row))
