"""The gains in force: the arrays that every step reads, as changes make them."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.setup import PlannedTask, Setup
from hsp_control.control.stiffening import changes_impedance, next_numbers
from hsp_control.tasks import Task
from hsp_control.tasks.task import InForce


class GainsMemory(NamedTuple):
    """What the gains remember besides the time line, by the tasks' keys."""

    waiting: dict[int, Array]
    offsets: dict[int, Array]


class GainsInForce:
    """Gains and impedances of the tasks, their offsets, and K_N, now."""

    def __init__(self, nv: int) -> None:
        """Allocate, without tasks."""
        # feedback of each task, by key; the arrays stay where they are
        self.feedback: dict[int, InForce] = {}
        self.null_space = np.zeros((nv, nv))  # K_N, shape (nv, nv) [1/s]
        self._tasks: dict[int, Task] = {}
        self._waiting: dict[int, Array] = {}

    def plan(self, setup: Setup, t: float) -> bool:
        """Follow a setup from now on; t is the present time [s]."""
        tasks = {each.key: each.task for each in setup.tasks}
        exchanged = any(
            self._tasks.get(key, task) is not task for key, task in tasks.items()
        )
        known = {id(task): self.feedback[key] for key, task in self._tasks.items()}
        self.feedback = {
            key: known.get(id(task)) or self._feedback_of(key, task)
            for key, task in tasks.items()
        }
        self._tasks, self._setup = tasks, setup
        self._changing = any(
            changes_impedance(each.task, each.gains) for each in setup.tasks
        )
        self._written: set[int] = set()
        self.write(t)
        return exchanged

    def _feedback_of(self, key: int, task: Task) -> InForce:
        """Return the feedback of a task that is new, or follows a new trajectory."""
        old = self._tasks.get(key)
        if old is not None and old.name == task.name and old.rows == task.rows:
            return self.feedback[key]
        return task.in_force()

    def write(self, t: float) -> None:
        """Write the gains of a time [s]."""
        for each in self._setup.tasks:
            if not (each.gains.constant and each.key in self._written):
                numbers = self._waiting.get(each.key)
                numbers = each.gains.at(t) if numbers is None else numbers
                self.feedback[each.key].numbers[:] = numbers
        self._written = set(self._tasks)
        self.null_space[:] = self._setup.gain.at(t)

    @property
    def stiffening(self) -> bool:
        """Whether impedances change, or wait; then `wait` belongs to each step."""
        return self._changing or bool(self._waiting)

    def wait(self, active: ActiveStack, t: float, period: float) -> None:
        """Let changes of impedances wait where they would add energy."""
        for each in self._setup.tasks:
            changes = each.key in self._waiting or changes_impedance(
                each.task, each.gains
            )
            rows = active.task_rows.get(each.task.name)
            if changes and rows is not None:
                self._follow(each, active, rows, t, period)

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
            planned.task.part_ends,
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

    def forget(self) -> None:
        """Forget the offsets, and what waits."""
        self._waiting.clear()
        for in_force in self.feedback.values():
            in_force.feedback.offset[:] = 0.0

    def memory(self) -> GainsMemory:
        """Return a copy of what to `remember`."""
        return GainsMemory(
            {key: each.copy() for key, each in self._waiting.items()},
            {key: each.feedback.offset.copy() for key, each in self.feedback.items()},
        )

    def remember(self, memory: GainsMemory) -> None:
        """Go on from a memory of the same setup."""
        self._waiting = {key: each.copy() for key, each in memory.waiting.items()}
        for key, numbers in self._waiting.items():
            self.feedback[key].numbers[:] = numbers
        for key, offset in memory.offsets.items():
            self.feedback[key].feedback.offset[:] = offset
