"""The gains in force: the arrays that every step reads, as changes make them.

Changes of an impedance add no energy: they wait where they would. With
E = ½ e'ᵀΛe' + U(e), U the energy of the spring, and an external force f,

    E' = fᵀx' - e'ᵀ(D + D_ζ) e' + ∂U/∂t.

A spring that becomes stiffer while it is stretched stores energy that nobody gave. So
the numbers in force follow those that were planned only as fast as ∂U/∂t is no more
than what the damping takes out: E' <= fᵀx', to first order in the period. Where they
are behind, they catch up in half of the change's ramp, so that no effort jumps.

Nor may a change make the running loop unstable. `check_rate` looks at a loop with its
delays and compensators before it runs. Where a change is made while it runs, the period
is known, and the robot's present state; the error of a task, x'' = -Kp x - Kv x', held
for the period h, then has the transition

    x(h) = x + h x' + ½ h² x'',     x'(h) = x' + h x''.
"""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import UnstableRateError
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.evolution import Evolution
from hsp_control.control.memory import RunMemory
from hsp_control.control.planned import PlannedTask
from hsp_control.control.setup import Setup
from hsp_control.declaration import within
from hsp_control.robot import RobotState
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.feedback import FeedbackInForce
from hsp_control.tasks.impedance import parts_of
from hsp_control.tasks.slipping import spring_force

_SMALLEST = 1e-15
"""Smallest scale of gains that is tried."""
_ROUNDING = 1e-7
"""Of the radius: a double eigenvalue of 1 has an error of the root of its rounding."""


class GainsInForce:
    """Gains and impedances of the tasks, their offsets, and K_N, now."""

    def __init__(self, nv: int, memory: RunMemory) -> None:
        self._memory, self._waiting = memory, memory.waiting
        # feedback of each task, by key; the arrays stay where they are
        self.feedback: dict[int, FeedbackInForce] = {}
        self.null_space = np.zeros((nv, nv))  # K_N, shape (nv, nv) [1/s]
        self._tasks: dict[int, Task] = {}

    def force_offset(self, contact: str) -> Array:
        """Return what compensators add to a contact's commanded force, (1,) [N]."""
        return self._memory.force_offset(contact)

    def plan(self, setup: Setup, t: float) -> None:
        """Follow a setup from now on; t is the present time [s]."""
        self.go_over_to(self.planned(setup), t)

    def planned(self, setup: Setup) -> "PlannedGains":
        """Return what is to be followed for a setup, which may be later."""
        tasks = {each.key: each.task for each in setup.tasks}
        known = {id(task): self.feedback[key] for key, task in self._tasks.items()}
        feedback = {
            key: known.get(id(task)) or self._feedback_of(key, task)
            for key, task in tasks.items()
        }
        changing = any(changes_impedance(each.task, each.gains) for each in setup.tasks)
        return PlannedGains(setup, tasks, feedback, changing)

    def go_over_to(self, planned: "PlannedGains", t: float) -> object:
        """Follow it from now on; t is the present time [s].

        Returns:
            What held the arrays of what was followed before.
        """
        before = self._tasks, self.feedback
        self._setup, self._tasks, self.feedback, self._changing = planned
        for kept in (self._waiting, self._memory.offsets):
            for key in kept.keys() - self._tasks.keys():
                del kept[key]
        self._written: set[int] = set()
        self._gain_written = False
        self.write(t)
        return before

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

    def write(self, t: float) -> None:
        """Write the gains of a time [s]."""
        for each in self._setup.tasks:  # what is constant is written once
            if not (each.gains.constant and each.key in self._written):
                numbers = self._waiting.get(each.key)
                numbers = each.gains.at(t) if numbers is None else numbers
                self.feedback[each.key].numbers[:] = numbers
        self._written = set(self._tasks)
        if not (self._gain_written and self._setup.gain.constant):
            self.null_space[:] = self._setup.gain.at(t)
            self._gain_written = True

    @property
    def stiffening(self) -> bool:
        """Whether impedances change, or wait; then `delay` belongs to each step."""
        return self._changing or bool(self._waiting)

    def delay(self, active: ActiveStack, t: float, period: float) -> None:
        """Let changes of impedances wait where they would add energy."""
        planned = {each.key: each for each in self._setup.tasks}
        for each in active.stacked:
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
        in_force = self.feedback[planned.key]
        following = next_numbers(
            in_force.numbers,
            planned.gains,
            planned.task.part_ends(),
            in_force.mobility,
            active.rows.error[rows],
            active.rows.error_rate[rows],
            t,
            period,
        )
        if following is None:
            self._waiting.pop(planned.key, None)
            following = planned.gains.at(t + period)
        else:
            self._waiting[planned.key] = following
        in_force.numbers[:] = following


class PlannedGains(NamedTuple):
    """What `GainsInForce` follows."""

    setup: Setup
    tasks: dict[int, Task]  # by key
    feedback: dict[int, FeedbackInForce]  # by key
    changing: bool  # whether an impedance changes


def changes_impedance(task: Task, numbers: Evolution[Array]) -> bool:
    """Return whether a task has an impedance that changes."""
    return impedance_of(task) is not None and not numbers.constant


def next_numbers(
    now: Array,
    planned: Evolution[Array],
    ends: Indices,
    mobility: Array,
    e: Array,
    e_dot: Array,
    t: float,
    period: float,
) -> Array | None:
    """Return the numbers of an impedance for the next period."""
    then = planned.at(t + period)
    step = then - now
    if not np.allclose(now, planned.at(t), rtol=1e-4, atol=1e-9):  # it has waited
        begun = [each.ramp for each in planned.transitions if each.start <= t]
        step *= min(2.0 * period / max(begun[-1] if begun else 0.3, period), 1.0)
    needed = spring_energy(now + step, ends, e) - spring_energy(now, ends, e)
    if needed > 0.0:
        given = period * dissipated(now, mobility, e_dot)
        if needed > given:
            return np.asarray(now + given / needed * step)
    return None if np.array_equal(now + step, then) else now + step


def spring_energy(numbers: Array, ends: Indices, e: Array) -> float:
    """Return U(e) = sᵀe - ½ sᵀK⁺s: ½ eᵀK e, and linear where s is at its bound."""
    force = spring_force(numbers, ends, e)
    length = np.linalg.pinv(parts_of(numbers).K, hermitian=True) @ force
    return float(force @ e - 0.5 * force @ length)


def dissipated(numbers: Array, mobility: Array, e_dot: Array) -> float:
    """Return e'ᵀ(D + D_ζ) e' [W], with D_ζ = 2 ζ C S⁻¹ Cᵀ, K = C Cᵀ, S² = Cᵀ Λ⁻¹ C."""
    K, D, ratio, *_ = parts_of(numbers)
    power = float(e_dot @ D @ e_dot)
    if ratio[0] > 0.0:
        stiffness, axes = np.linalg.eigh(K)
        C = axes * np.sqrt(np.maximum(stiffness, 0.0))
        squares, modes = np.linalg.eigh(C.T @ mobility @ C)
        along = modes.T @ C.T @ e_dot
        frequencies = np.sqrt(np.maximum(squares, np.finfo(float).tiny))
        # Where the arm has no mobility it does not move.
        power += float(2.0 * ratio[0] * (along**2 / frequencies).sum())
    return power


def check_held(old: Setup, new: Setup, state: RobotState, period: float) -> None:
    """Check what a change of the setup makes of gains, where the robot is now."""
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
