"""The gains in force: the arrays that every step reads and changes write.

Changes of an impedance add no energy: they wait where they would; see
`FollowedImpedance`.

Nor may a change make the running loop unstable. `check_rate` looks at a loop with its
delays and compensators before it runs. Where a change is made while it runs, the period
is known, and the robot's present state; the error of a task, x'' = -Kp x - Kv x', held
for the period h, then has the transition

    x(h) = x + h x' + ½ h² x'',     x'(h) = x' + h x''.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import UnstableRateError
from hsp_control.control.active_stack import ActiveStack, tasks_of
from hsp_control.control.evolution import Evolution
from hsp_control.control.followed_impedance import FollowedImpedance
from hsp_control.control.memory import RunMemory, Waiting
from hsp_control.control.planned import PlannedTask
from hsp_control.control.setup import Setup
from hsp_control.declaration import within
from hsp_control.engine.plans import TIME, PartCall, PartCalls
from hsp_control.robot import RobotState
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.feedback import FeedbackInForce

_SMALLEST = 1e-15
"""Smallest tried scale of gains."""
_ROUNDING = 1e-7
"""Tolerance of the radius: a double eigenvalue of 1 has the error √rounding."""


class GainsInForce:
    """Gains and impedances of the tasks, their offsets, and K_N, now."""

    calls: PartCalls  # those that write changing values, at a time

    def __init__(self, nv: int, memory: RunMemory) -> None:
        self._memory, self._waiting = memory, memory.waiting
        # feedback of each task, by key; the arrays stay where they are
        self.feedback: dict[int, FeedbackInForce] = {}
        self.null_space = np.zeros((nv, nv))  # K_N, shape (nv, nv) [1/s]
        self._tasks: dict[int, Task] = {}
        self._followed: dict[int, FollowedImpedance] = {}

    def force_offset(self, contact: str) -> Array:
        """Return the compensators' part of a contact's commanded force, (1,) [N]."""
        return self._memory.force_offset(contact)

    def plan(self, setup: Setup, t: float) -> None:
        """Follow a setup from now on; t is the present time [s]."""
        self.go_over_to(self.planned(setup))
        self.write_all(t)

    def planned(self, setup: Setup) -> "PlannedGains":
        """Return the gains of a setup, which may be followed later."""
        tasks = {each.key: each.task for each in setup.tasks}
        known = {id(task): self.feedback[key] for key, task in self._tasks.items()}
        feedback = {
            key: known.get(id(task)) or self._feedback_of(key, task)
            for key, task in tasks.items()
        }
        followed = {
            each.key: self._follower(each, feedback[each.key])
            for each in setup.tasks
            if impedance_of(each.task) is not None
        }
        changing = any(changes_impedance(each.task, each.gains) for each in setup.tasks)
        calls = self._evolving(setup, feedback)
        if changing:
            calls.append(PartCall(self._write_impedances, t=TIME))
        return PlannedGains(setup, tasks, feedback, followed, changing, calls)

    def go_over_to(self, planned: "PlannedGains") -> object:
        """Follow it from now on; return the record that was followed before."""
        before = self._tasks, self.feedback, self._followed
        self._setup, self._tasks, self.feedback, self._followed, *_ = planned
        self._changing, self.calls = planned.changing, planned.calls
        for kept in (self._waiting, self._memory.offsets):
            for key in kept.keys() - self._tasks.keys():
                del kept[key]
        return before

    def _follower(
        self, planned: PlannedTask, in_force: FeedbackInForce
    ) -> FollowedImpedance:
        """Return the impedance in force of a task, which follows the planned one."""
        own = self._followed.get(planned.key)
        if own is not None and own.numbers is in_force.numbers:
            return own
        return FollowedImpedance(in_force, planned.task.part_ends())

    def _feedback_of(self, key: int, task: Task) -> FeedbackInForce:
        """Return the feedback of a task that is new, or follows a new trajectory."""
        old = self._tasks.get(key)
        if old is not None and old.name == task.name and old.rows == task.rows:
            return self.feedback[key]
        in_force, offsets = task.in_force(), self._memory.offsets
        if key not in offsets or len(offsets[key]) != task.rows:
            offsets[key] = in_force.feedback.offset
        feedback = in_force.feedback._replace(offset=offsets[key])
        return in_force._replace(feedback=feedback)

    def _evolving(
        self, setup: Setup, feedback: Mapping[int, FeedbackInForce]
    ) -> list[PartCall]:
        """Return the calls of a setup that write changing values except impedances."""
        calls = list[PartCall]()
        for each in setup.tasks:
            if impedance_of(each.task) is None and not each.gains.constant:
                calls.append(each.gains.call(feedback[each.key].numbers))
        if not setup.gain.constant:
            calls.append(setup.gain.call(self.null_space))
        return calls

    def write_all(self, t: float) -> None:
        """Write the gains of a time [s], also those that are constant."""
        for each in self._setup.tasks:
            self._write_task(each, t)
        self.null_space[:] = self._setup.gain.at(t)

    def _write_impedances(self, t: float) -> None:
        for each in self._setup.tasks:
            if changes_impedance(each.task, each.gains):
                self._write_task(each, t)

    def _write_task(self, planned: PlannedTask, t: float) -> None:
        waits = self._waiting.get(planned.key)
        numbers = planned.gains.at(t) if waits is None else waits.numbers
        self.feedback[planned.key].numbers[:] = numbers

    @property
    def stiffening(self) -> bool:
        """Whether impedances change, or wait; then `delay` belongs to every step."""
        return self._changing or bool(self._waiting)

    def delay(self, resolved: Sequence[ActiveStack], t: float, period: float) -> None:
        """Delay changes of impedances that would add energy."""
        planned = {each.key: each for each in self._setup.tasks}
        for _, active, each in tasks_of(resolved):
            now = planned.get(each.planned.key)
            if now is None:  # a change has ended it since
                continue
            if now.key in self._waiting or changes_impedance(now.task, now.gains):
                self._follow(now, active, each.rows, t, period)

    def _follow(
        self,
        planned: PlannedTask,
        active: ActiveStack,
        rows: slice,
        t: float,
        period: float,
    ) -> None:
        key, gains = planned.key, planned.gains
        followed, waits = self._followed[key], self._waiting.get(key)
        begun = [each.ramp for each in gains.transitions if each.start <= t]
        if begun:
            followed.ramp[0] = begun[-1]
        elif waits is not None:
            followed.ramp[0] = waits.ramp
        error, rate = active.rows.error[rows], active.rows.error_rate[rows]
        if followed.move(gains.at(t), gains.at(t + period), error, rate, period):
            self._waiting[key] = Waiting(
                followed.numbers.copy(), float(followed.ramp[0])
            )
        else:
            self._waiting.pop(key, None)


class PlannedGains(NamedTuple):
    """The gains of a setup, for `GainsInForce`."""

    setup: Setup
    tasks: dict[int, Task]  # by key
    feedback: dict[int, FeedbackInForce]  # by key
    followed: dict[int, FollowedImpedance]  # by key, of those with an impedance
    changing: bool  # whether an impedance changes
    calls: PartCalls  # those that write changing values, at a time


def changes_impedance(task: Task, numbers: Evolution[Array]) -> bool:
    """Return whether a task has an impedance that changes."""
    return impedance_of(task) is not None and not numbers.constant


def check_held(old: Setup, new: Setup, state: RobotState, period: float) -> None:
    """Check the gains after a change of the setup, at the present state."""
    before = {each.key: each.gains.target for each in old.tasks}
    for each in new.tasks:
        if not np.array_equal(each.gains.target, before.get(each.key, ())):
            _check_task(each, state, period)
    if not np.array_equal(new.gain.target, old.gain.target):
        rate = float(np.abs(np.linalg.eigvals(new.gain.target)).max())
        if rate * period >= 2.0:
            with within("gain"):
                raise UnstableRateError(
                    f"K_N = {rate:.4g} 1/s held for {period:g} s makes the loop "
                    f"unstable; needs less than {rounded_down(2.0 / period)} 1/s"
                )


def _check_task(planned: PlannedTask, state: RobotState, period: float) -> None:
    task, in_force = planned.task, planned.task.in_force()
    in_force.numbers[:] = planned.gains.target
    Kp, Kv, *_ = task.linear_feedback(state, in_force)
    compliant = impedance_of(task) is not None
    if task.order == 1:  # e' + K e = 0, with K in the place of Kp
        Kp, Kv = np.zeros_like(Kp), Kp
    if held_radius(Kp, Kv, period) < 1.0 + _ROUNDING:
        return
    least, most = _SMALLEST, 1.0
    for _ in range(50):
        scale = float(np.sqrt(least * most))
        stable = held_radius(scale**2 * Kp, scale * Kv, period) < 1.0 + _ROUNDING
        least, most = (scale, most) if stable else (least, scale)
    what = "this impedance" if compliant else "these gains"
    square, factor = rounded_down(least**2), rounded_down(least)
    advice = (
        f"at most {square} times this stiffness and {factor} times this damping"
        if compliant
        else f"at most {factor} times these rates"
    )
    with within("impedance" if compliant else "gains"):
        raise UnstableRateError(
            f"{what} of task {task.name!r}, held for {period:g} s, would make the loop "
            f"unstable where the robot is; needs {advice}"
        )


def held_radius(Kp: Array, Kv: Array, period: float) -> float:
    """Return the spectral radius of x'' = -Kp x - Kv x', held for a period."""
    one, h = np.eye(len(Kp)), period
    transition = np.block(
        [[one - 0.5 * h * h * Kp, h * one - 0.5 * h * h * Kv], [-h * Kp, one - h * Kv]]
    )
    return float(np.abs(np.linalg.eigvals(transition)).max())


def rounded_down(value: float) -> str:
    """Return a number rounded down to three digits, so that advice is safe."""
    exponent = int(np.floor(np.log10(value))) - 2
    unit = 10.0**exponent
    return f"{np.floor(value / unit + 1e-6) * unit:.10g}"
