"""The active stack: the law for the contacts and tasks active at one time."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.common.step_plan import StepPlan, steps
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.contacts.unactuated import UnactuatedRows, unactuated_count
from hsp_control.control.actuation.support import Support
from hsp_control.law import Outcome, Resolution
from hsp_control.law.outcome import OUTCOMES
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Task, TaskSample


class ActiveStack:
    """The law for one set of contacts and tasks, with rows in order of priority.

    With a floating base the first level keeps the contacts at rest, and requires zero
    effort along base motions that neither motors nor contacts can drive. The levels of
    the tasks follow, then the field.

    Attributes:
        contacts: The active contacts.
        levels: The tasks of each level.
        support: The contacts' forces and their bounds.
        resolution: The law.
        task_rows: The rows of each task in the stack, by name.
        contact_rows: The rows of each contact, by name.
        first_task_row: Index of the first row that belongs to a task.
        rows: All rows stacked: J, J', e, e', a_x.
    """

    def __init__(
        self,
        state: RobotState,
        contacts: Sequence[Contact],
        levels: Sequence[Sequence[Task]],
        base: Indices,
        support: Support,
        metric: Metric,
        gain: Array,
        threshold: float,
    ) -> None:
        """Stack the rows; the state decides which base motions the contacts permit."""
        robot: Robot = state.robot
        self.contacts = tuple(contacts)
        self.levels = tuple(tuple(level) for level in levels if level)
        self.support = support
        held = sum(contact.rows for contact in contacts)
        free = unactuated_count(_jacobian(contacts, state), base) if base.size else 0
        first = [held + free] if held + free else []
        sizes = [sum(task.rows for task in level) for level in self.levels]
        self.resolution = Resolution(
            first + sizes, robot.nv, metric.form, gain, threshold
        )
        problem = self.resolution.problem
        self.rows = problem.task
        self._held, self._rest = self.rows.rows(0, held), None
        if free:
            self._rest = UnactuatedRows(robot, base, free)
            self._free = self.rows.rows(held, held + free)
        self._steps = IdentityCache(self._compile)
        self.contact_rows = _places(self.contacts, 0)
        tasks = [task for level in self.levels for task in level]
        self.first_task_row = held + free
        self.task_rows = _places(tasks, self.first_task_row)
        parts: list[Task | Contact] = [*self.contacts, *tasks]
        places = [*self.contact_rows.values(), *self.task_rows.values()]
        self._parts = tuple(
            (part, self.rows.rows(where.start, where.stop))
            for part, where in zip(parts, places, strict=True)
        )

    def resolve(
        self, state: RobotState, metric: Metric, field: NullSpaceField
    ) -> Outcome:
        """Resolve contacts, tasks and field; `resolution` holds the results."""
        t, outcome = state.t, 0.0
        for step in self._steps.get(state, metric, field):
            outcome = step(t)
        return OUTCOMES[int(outcome)]

    def _compile(
        self, state: RobotState, metric: Metric, field: NullSpaceField
    ) -> list[Callable[[float], Any]]:
        """Return the calls of a step, each of the time, in order."""
        problem = self.resolution.problem
        plans = [part.compile(state, sample) for part, sample in self._parts]
        if self._rest is not None:
            rest = partial(self._rest.evaluate, state, self._held, self._free)
            plans.append(StepPlan(write=(rest,)))
        plans.append(metric.compile(state, problem.metric))
        plans.append(field.compile(state, problem.metric, metric.form, problem.field))
        law = self.resolution.compile(state.v, controls=field.controls)
        return steps(plans, law)

    def not_finite(self) -> str | None:
        """Return the first task or contact whose sample contains NaN or inf, if any."""
        for part, sample in self._parts:
            if not all(np.isfinite(array).all() for array in sample):
                kind = "task" if isinstance(part, Task) else "contact"
                return f"{kind} {part.name!r}"
        return None


def _places(parts: Sequence[Task] | Sequence[Contact], start: int) -> dict[str, slice]:
    places = {}
    for part in parts:
        places[part.name] = slice(start, start + part.rows)
        start += part.rows
    return places


def _jacobian(contacts: Sequence[Contact], state: RobotState) -> Array:
    nv = state.robot.nv
    rows = [
        contact.evaluate(state, TaskSample.allocate(contact.rows, nv)).jacobian
        for contact in contacts
    ]
    return np.vstack([np.zeros((0, nv)), *rows])
