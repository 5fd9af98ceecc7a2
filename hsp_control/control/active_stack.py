"""The active stack: the law for the contacts and tasks active at one time."""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cached_property, partial
from itertools import chain
from typing import Any, NamedTuple, NoReturn

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import NonFiniteError
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.contacts.contact import UnactuatedRows, unactuated_count
from hsp_control.control.actuation.support import Support
from hsp_control.control.planned import PlannedTask
from hsp_control.control.shown_stack import shown_stack
from hsp_control.declaration.nested import parts_within
from hsp_control.edge import BoundLaw
from hsp_control.edge.threshold import Following
from hsp_control.engine.plans import AnyCall, PartCall
from hsp_control.law import CONSTANT, FieldSample, Outcome, TaskSample
from hsp_control.null_space.fields import FieldSum, NullSpaceField
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.state import as_given
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.feedback import FeedbackInForce, beyond_largest
from hsp_control.tasks.impedance import parts_of
from hsp_control.tasks.slipping import slipped
from hsp_control.trajectories.streams.followed import FollowedStream


class Layout(NamedTuple):
    """The rows of a stack."""

    rows: int
    places: Mapping[str, slice]  # the rows of each task, by name
    # tasks with a largest error: the name, the rows, and `Feedback.largest`
    bounds: Sequence[tuple[str, slice, Callable[[Array], float]]]


class StackedTask(NamedTuple):
    """A task in a stack."""

    planned: PlannedTask
    name: str  # the task's name; another one while a newer task of this name fades in
    rows: slice
    in_force: FeedbackInForce


class ActiveStack:
    """The law for one set of contacts and tasks, with rows in order of priority.

    With a floating base the first level keeps the contacts at rest, and requires zero
    effort along base motions that neither motors nor contacts can drive. The levels of
    the tasks follow, then the field.
    """

    share = 1.0  # its share in the mixture that was resolved last, in (0, 1]

    def __init__(
        self,
        state: RobotState,
        support: Support,
        levels: Sequence[Sequence[PlannedTask]],
        feedback: Mapping[int, FeedbackInForce],
        metric: Metric,
        field: NullSpaceField,
        gain: Array,
        threshold: float,
    ) -> None:
        # from its state: the base motions that contacts permit
        robot: Robot = state.robot
        self.support, base = support, support.base  # contacts' forces, their bounds
        self.contacts = support.contacts
        planned = [level for level in levels if level]
        self.levels = tuple(tuple(each.task for each in level) for level in planned)
        held = sum(contact.rows for contact in self.contacts)
        free = (
            unactuated_count(_jacobian(self.contacts, state), base) if base.size else 0
        )
        first = [held + free] if held + free else []
        sizes = [sum(task.rows for task in level) for level in self.levels]
        of_tasks = chain(*(task.error_parts for task in chain(*self.levels)))
        self.law = BoundLaw(
            first + sizes,
            robot.nv,
            metric.form,
            gain,
            threshold,
            Following.of(robot.size, on_legs=bool(robot.unactuated)),
            parts=[
                *(contact.rows for contact in self.contacts),
                *([free] if free else []),
                *(part.size for part in of_tasks),
            ],
            controls=field.controls,
        )
        self.rows = self.law.problem.task  # all rows stacked: J, J', e, e', a_x
        self.streamed = any(
            True for _ in parts_within([*self.levels, field], FollowedStream)
        )
        self.forces, self.has_forces = support.forces, support.size > 0
        # rows, the field and the law's results, in one block: see `StepRecord`
        self.memory = self.law.problem.record.memory
        self.acceleration = self.law.acceleration
        self.contact_rows = _places(self.contacts, 0)  # rows of each contact, by name
        self.first_task_row = held + free
        tasks = [each for level in planned for each in level]
        below = {each.key for level in planned[1:] for each in level}
        self.stacked = _stacked(tasks, self.first_task_row, feedback)
        self.task_rows = {each.name: each.rows for each in self.stacked}
        bounds: list[tuple[str, slice, Callable[[Array], float]]] = []
        self.layout = Layout(len(self.rows.error), self.task_rows, bounds)
        self._parts: list[tuple[Task | Contact, TaskSample]] = []
        self._calls: list[AnyCall] = []
        row = 0
        for contact in self.contacts:
            sample = self.rows.rows(row, row + contact.rows)
            self._parts.append((contact, sample))
            self._calls += contact.calls(state, sample)
            row += contact.rows
        for each, name, here, in_force in self.stacked:
            sample = self.rows.rows(here.start, here.stop)
            self._parts.append((each.task, sample))
            self._calls += each.task.calls_in_force(state, in_force, sample)
            demand = self.law.problem.demand[here]
            spring = impedance_of(each.task) is not None
            self.law.problem.springs[here] = spring
            if spring:
                ends = each.task.part_ends()
                away = partial(slipped, in_force.numbers, ends)
                pulls = self.law.problem.pulls[here]
                call = PartCall(
                    engine.SpringPulls,
                    impedance=parts_of(in_force.numbers),
                    ends=ends,
                    e=sample.error,
                    pulls=pulls,
                )
                self._calls.append(call)
                bounds.append((name, here, away))
            elif len(in_force.feedback.largest):
                away = partial(beyond_largest, largest=in_force.feedback.largest)
                bounds.append((name, here, away))
                parts = each.task.error_parts
                yields = [part.yields for part in parts for _ in range(part.size)]
                self.law.problem.yields[here] = yields
            # The demand of balance tasks is not bounded: the robot would fall.
            balances = robot.unactuated and each.task.keeps_balance(robot)
            follows = each.key in below or len(in_force.feedback.largest)
            draws = spring and below  # with levels below it
            if (follows or draws) and not balances:
                # at zero velocity, so that damping is kept at any speed
                stretched = self.law.problem.stretched[here]
                call = PartCall(
                    engine.DemandAtRest,
                    feedback=in_force.feedback,
                    e=sample.error,
                    demand=demand,
                    stretched=stretched,
                )
                self._calls.append(call)
            elif not spring:
                self.law.problem.demands_known = False
        # names of each level's tasks; ``contacts`` for those at the top
        self.level_names = [
            *(["contacts"] if first else []),
            *(", ".join(task.name for task in level) for level in self.levels),
        ]
        self._rest = None
        if free:
            self._rest = UnactuatedRows(robot, base, free)
        self._held = held
        self._state, self._metric, self._field = state, metric, field
        # weighted sample of each term of the field
        self.term_samples: tuple[FieldSample, ...] = ()

    def resolve(self, t: float) -> Outcome:
        """Resolve contacts, tasks and field at the state, into `law`."""
        self._plan(t)
        return self.law.outcome.outcome

    @cached_property
    def shown(self) -> "ActiveStack":
        """A read-only view of this stack, for code outside of its step."""
        return shown_stack(self)

    @property
    def damped_level(self) -> int:
        """The first level with a bounded inverse in the last `resolve`; 0: none."""
        return int(self.law.outcome.damped_level[0])

    @property
    def damped(self) -> str:
        """The names of that level's tasks, or ``contacts``; empty: none."""
        level = self.damped_level
        return self.level_names[level - 1] if level else ""

    def bind(self) -> None:
        """Bind the calls of `resolve` now, and run them once.

        A part, or a user's function, may make something at its first use. A stream's
        messages belong to a time, and an exception is raised in the step that meets it.
        """
        if "_plan" in self.__dict__:
            return
        plan, state = self._plan, self._state
        if not self.streamed and state.stamp:
            with suppress(Exception):
                plan(state.t)

    @cached_property
    def _plan(self) -> engine.Plan:
        return engine.Plan(self.calls)

    @cached_property
    def calls(self) -> list[Callable[[float], Any]]:
        """The calls of `resolve`, functions of the time [s]; bound when first read."""
        state, metric, field = self._state, self._metric, self._field
        problem = self.law.problem
        calls = [*self._calls]
        if self._rest is not None:
            held = self.rows.rows(0, self._held)
            free = self.rows.rows(self._held, self.first_task_row)
            rest = PartCall(self._rest.evaluate, state=state, contacts=held, out=free)
            calls.append(rest)
        calls += metric.calls(state, problem.metric)
        sample, form = problem.field, metric.form
        if isinstance(field, FieldSum):
            self.term_samples = field.allocate_terms(state.robot.nv)
            calls += field.calls_of_terms(
                state, problem.metric, form, sample, self.term_samples
            )
        else:
            self.term_samples = (sample,)
            calls += field.calls(state, problem.metric, form, sample)
        calls.append(self.law.call(state.v))
        return state.plan(calls).steps()

    def field_value(self) -> float:
        """Return the field's value at the state that logs have: bound only for it."""
        return self._field.value(self._state.read_only)

    def diagnose(self) -> tuple[float, float, bytes]:
        """Return ‖e_N‖_W, the manipulability, and the input of `singular_values`.

        They are those of the last `resolve`.
        """
        call, triangle, length = self._diagnosis
        manipulability = call()
        return abs(length.item()), manipulability, triangle.tobytes()  # no -0

    @cached_property
    def _diagnosis(self) -> tuple[Callable[[], float], Array, Array]:
        call, triangle, length = self.law.diagnosis(self.first_task_row)
        return self._state.plan([call]).call(), triangle, length

    def flow(self) -> Array:
        """Return J# x_d' + P g, shape (nv,), at the resolved state, at rest."""
        law, state = self.law, self._state
        # At rest, without drift and with unit gain the law's acceleration is the flow.
        nv, form = state.robot.nv, min(self._metric.form, CONSTANT)
        sizes = np.diff(law.ends, prepend=0).tolist()
        flow = BoundLaw(sizes, nv, form, np.eye(nv), law.threshold)
        flow.problem.task.jacobian[:] = self.rows.jacobian
        for each in self.stacked:
            rate = each.planned.task.reference_rate(state.read_only)
            flow.problem.task.acceleration[each.rows] = rate
        flow.problem.field.g[:] = law.problem.field.g
        flow.problem.metric.W[:], flow.problem.metric.L[:] = law.problem.metric[:2]
        state.run([flow.call(state.v)])
        return flow.acceleration

    def check(self, effort: Array) -> None:
        """Raise if an effort that a step delivers is not finite."""
        if not np.isfinite(effort).all():
            self.raise_not_finite()

    def raise_not_finite(self) -> NoReturn:
        """Raise an error for the part that made a step's effort NaN or infinite."""
        state, problem = self._state, self.law.problem
        for part, sample in self._parts:
            if not all(np.isfinite(array).all() for array in sample):
                kind = "task" if isinstance(part, Task) else "contact"
                raise NonFiniteError(
                    f"{kind} {part.name!r} is not finite at t = {state.t:.6g} s; "
                    "does its trajectory return NaN or infinity there?"
                )
        if not all(np.isfinite(array).all() for array in problem.field):
            self._field.value(state.read_only)  # may raise a more precise error
            raise NonFiniteError(
                f"field {self._field.name!r} is not finite at t = {state.t:.6g} s"
            )
        given = as_given(self._metric, state)
        self._metric.evaluate(given, problem.metric)  # may raise a more precise error
        raise NonFiniteError(
            f"the effort is not finite at t = {state.t:.6g} s, "
            f"q = {state.q.tolist()}, v = {state.v.tolist()}"
        )


def tasks_of(
    resolved: Sequence[ActiveStack],
) -> Iterator[tuple[str, ActiveStack, StackedTask]]:
    """Yield each task of the stacks of a step once: its name, its stack, and its place.

    The last stack is the active one; it has all tasks except those that others replace.
    Stacks with fewer contacts are left out: theirs may begin where a contact ends.
    """
    *others, active = resolved
    for each in active.stacked:
        yield each.name, active, each
    if not others:
        return
    there = {each.planned.key: each.planned for each in active.stacked}
    found = list[tuple[ActiveStack, StackedTask]]()
    for stack in reversed(others):
        for each in stack.stacked if stack.contacts == active.contacts else ():
            if each.planned.key not in there:
                there[each.planned.key] = each.planned
                found.append((stack, each))
    for stack, each in found:
        name = name_among(each.planned, there.values())
        if name in active.task_rows:  # the older one, in the active stack
            name = f"{name} (new)"
        yield name, stack, each


def _stacked(
    tasks: Sequence[PlannedTask], start: int, feedback: Mapping[int, FeedbackInForce]
) -> list[StackedTask]:
    """Return the tasks of a stack, one below the other from a row on."""
    stacked, row = list[StackedTask](), start
    for each in tasks:
        rows = slice(row, row + each.task.rows)
        name = name_among(each, tasks)
        stacked.append(StackedTask(each, name, rows, feedback[each.key]))
        row = rows.stop
    return stacked


def name_among(own: PlannedTask, tasks: Iterable[PlannedTask]) -> str:
    """Return a task's name, or another one if there is a newer task of this name."""
    name = own.task.name
    newer = sum(each.task.name == name and each.key > own.key for each in tasks)
    if not newer:
        return name
    return f"{name} (old)" if newer == 1 else f"{name} (old, {newer})"


def _places(contacts: Sequence[Contact], start: int) -> dict[str, slice]:
    places = {}
    for contact in contacts:
        places[contact.name] = slice(start, start + contact.rows)
        start += contact.rows
    return places


def _jacobian(contacts: Sequence[Contact], state: RobotState) -> Array:
    nv = state.robot.nv
    rows = [
        contact.evaluate(state, TaskSample.allocate(contact.rows, nv)).jacobian
        for contact in contacts
    ]
    return np.vstack([np.zeros((0, nv)), *rows])
