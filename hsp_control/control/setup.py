"""What a controller is made of, how that evolves, and whether it fits together."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import (
    ContactError,
    ControllerError,
    FieldError,
    GainError,
)
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.constraints.contacts import CommandedForce, Contact
from hsp_control.constraints.contacts.contact import NORMAL
from hsp_control.constraints.limits import Limits, RobotLimits
from hsp_control.control.evolution import (
    ABSENT,
    PRESENT,
    Evolution,
    EvolvingWeight,
    PlannedContact,
    PlannedLimits,
)
from hsp_control.control.model_in_force import PlannedPayload
from hsp_control.control.tools_in_force import PlannedTool
from hsp_control.declaration import Part, within
from hsp_control.declaration.language import check_kind, shortened
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.quantities import LARGEST
from hsp_control.geometry.scene import Obstacle, Scene, Start
from hsp_control.law import VARYING, MetricSample
from hsp_control.null_space.fields import FieldSum, NullSpaceField, Rest
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.fields.weight import (
    ConstantWeight,
    SetWeight,
    Weight,
    product,
)
from hsp_control.null_space.metrics import IdentityMetric, MassMatrixMetric, Metric
from hsp_control.robot import Robot
from hsp_control.robot.state import as_given
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.gains import as_gain, as_matrix
from hsp_control.trajectories.crossfade import settled
from hsp_control.trajectories.hold import SetPoint
from hsp_control.trajectories.schedule import Schedule
from hsp_control.trajectories.streams.streamed import Streamed

_MOST = 500
"""Events that are looked at: a schedule may repeat itself for hours."""
_BETWEEN = 6
"""Times that are looked at between two of them."""

Base = Literal["flying", "driven"]
"""What else than contacts acts on a free-flyer root: nothing, or an outside device."""


def _check_parts(what: str, parts: object, kind: type[Part]) -> None:
    """Check that an argument is several parts of a kind."""
    if isinstance(parts, kind | Mapping | str) or not isinstance(parts, Iterable):
        raise ControllerError(
            f"{what} is {shortened(repr(parts))}; needs several, such as "
            f"[{kind.__name__.lower()}]"
        )
    for part in parts:
        if isinstance(part, list | tuple):
            raise ControllerError(
                f"{what} contains lists; write the level as priority=1, 2, ... of each "
                "task"
            )
        check_kind(f"{what} contains", part, kind, ControllerError)


def check_tasks(tasks: Sequence[Task], robot: Robot) -> None:
    """Check that tasks have different names, and that no level is large."""
    names = [task.name for task in tasks]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ControllerError(
            f"two tasks are called {twice[0]!r}; give them distinct names"
        )
    for priority in sorted({priority_of(task, robot) for task in tasks}):
        level = [task for task in tasks if priority_of(task, robot) == priority]
        rows = sum(task.rows for task in level)
        if rows > robot.nv:
            each_of = ", ".join(f"{task.name}: {task.rows}" for task in level)
            where = "" if len(level) == len(tasks) else f" of priority {priority}"
            raise ControllerError(
                f"the tasks{where} have {rows} rows ({each_of}); "
                f"{robot.name} has only {robot.nv} degrees of freedom"
            )


def priority_of(task: Task, robot: Robot) -> int:
    """Return the priority of a placed task, 1 the highest."""
    # Without one of its own it is 1; on a floating base 1 for what keeps the balance,
    # and 2 for all else, so that no hand that reaches too far makes the robot fall.
    if task.priority is not None:
        return task.priority
    return 2 if robot.unactuated and not task.keeps_balance(robot) else 1


def checked_gain(gain: ArrayLike, robot: Robot, metric: Metric) -> Array:
    """Return K_N as a matrix, checked for V' = -e_NᵀW K_N e_N < 0.

    So W K_N + K_NᵀW must be positive definite. Where W is constant that is looked at.
    Where W changes with q it must hold for every W(q): for multiples of the identity it
    does, since then V' = -2 K_N V, and other gains are refused. A diagonal of positive
    numbers is not enough: over the mass matrix some let e_N grow at some
    configurations.
    """
    K_N = as_matrix(np.asarray(gain, dtype=float), robot.nv, "null_space_gain")
    if np.abs(K_N).max() > LARGEST:
        raise GainError(
            f"null_space_gain contains {np.abs(K_N).max():g}, which is absurdly large; "
            f"its size must be {LARGEST:g} at most"
        )
    if metric.form == VARYING:
        if not np.array_equal(K_N, K_N[0, 0] * np.eye(robot.nv)):
            raise GainError(
                "null_space_gain is no multiple of the identity, and the metric "
                f"({type(metric).__name__}) changes with the configuration: at some "
                "configurations the null-space error could grow instead of decay; "
                f"needs one number, for example {np.diag(K_N).min():g}, or a metric "
                "that does not change"
            )
        return K_N
    state = robot.state(0.0, robot.neutral(), np.zeros(robot.nv))
    state = as_given(metric, state)
    W = metric.evaluate(state, MetricSample.allocate(robot.nv)).W
    decay = W @ K_N
    smallest = float(np.linalg.eigvalsh(0.5 * (decay + decay.T))[0])
    if smallest <= 0.0:
        raise GainError(
            "null_space_gain does not make the null-space error decay: the smallest "
            f"eigenvalue of W K_N is {smallest:.3g}; must be greater than 0"
        )
    return K_N


def check_support(robot: Robot, contacts: Sequence[Contact], base: Base | None) -> None:
    """Check that contacts and ``base`` are given exactly where the robot needs them."""
    if base not in {None, "flying", "driven"}:
        raise ContactError(f"base is {base!r}; needs 'flying', 'driven' or None")
    if not robot.unactuated and base is not None:
        with within("base"):
            raise ContactError(
                f"{robot.name} has no free-flyer root: base is only for robots with a "
                "floating base"
            )
    if robot.unactuated and not contacts and base is None:
        raise ContactError(
            f"no motor moves the free-flyer root of {robot.name}: declare contacts, or "
            "base='flying' (nothing acts on it), or base='driven' (something else "
            "moves it)"
        )
    if contacts and base == "driven":
        with within("base"):
            raise ContactError(
                "base='driven' needs no contacts, but contacts are given"
            )
    names = [contact.name for contact in contacts]
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise ContactError(
            f"two contacts are called {twice[0]!r}; give them distinct names"
        )


@dataclass(frozen=True)
class PlannedTask:
    """A task, when it is active, and its gains."""

    key: int  # tells it from every other task of the controller, also of the same name
    task: Task  # placed
    presence: Evolution[float]  # 1 while it is part of the controller, 0 while not
    # numbers of its feedback: Kp and Kv, shape (2, m, m) [1/s², 1/s], or those of an
    # impedance; see `Task.in_force`
    gains: Evolution[Array]

    def weight(self, t: float) -> float:
        """Return the weight of the task at time t [s], in [0, 1]."""
        present = self.presence.at(t)
        schedule = self.task.schedule
        return present if schedule is None else present * schedule.weight(t)

    def weight_beyond(self, t: float, edges: Sequence[float]) -> float:
        """Return its weight at time t where some contacts are lifted.

        A task without a ramp that begins where a contact ends moves what the contact
        kept at rest. So it is active before, in proportion as the contact is not; so is
        one that ends where a contact begins.
        """
        now, schedule = self.weight(t), self.task.schedule
        if schedule is None or schedule.ramp or 0.0 < now < 1.0:
            return now
        present = self.presence.at(t)
        there = (present * schedule.weight(edge) for edge in edges)
        return next((each for each in there if each != now), now)

    @property
    def always(self) -> bool:
        """Whether its weight is 1 at all times."""
        schedule = self.task.schedule
        unscheduled = schedule is None or (schedule.constant and not schedule.ramp)
        return unscheduled and self.presence == PRESENT


@dataclass(frozen=True)
class PlannedTerm:
    """A term of the field, and when it is active."""

    field: NullSpaceField  # placed, with its own weight
    presence: Evolution[float]  # factor of its weight

    @property
    def weighted(self) -> NullSpaceField:
        """The term with both weights."""
        if self.presence == PRESENT:
            return self.field
        weight = product(EvolvingWeight(self.presence), self.field.weight)
        return replace(self.field, weight=weight)

    @property
    def weight(self) -> Evolution[float] | None:
        """The term's own weight in time; None: it is a ramp, or of the state."""
        own = self.field.weight
        if isinstance(own, EvolvingWeight):
            return own.evolution
        if isinstance(own, ConstantWeight):
            return Evolution(own.value)
        return None if isinstance(own, Weight) else Evolution(float(own))

    def with_weight(self, weight: Evolution[float]) -> "PlannedTerm":
        """Return the term with another weight of its own."""
        own = weight.initial if weight.constant else EvolvingWeight(weight)
        return replace(self, field=replace(self.field, weight=own))

    def settled(self, t: float) -> "PlannedTerm":
        """Return the term for times from t on: complete changes are folded."""
        field, presence = settled(self.field, t), self.presence.settled(t)
        term = _changed(self, field=field, presence=presence)
        weight = term.weight
        if weight is None or (later := weight.settled(t)) is weight:
            return term
        return term.with_weight(later)


@dataclass(frozen=True)
class Setup:
    """All parts of a controller, as a function of time."""

    start: Start  # where the parts were placed
    metric: Metric
    tasks: tuple[PlannedTask, ...]
    terms: tuple[PlannedTerm, ...]  # terms of the field; their sum is the field
    gain: Evolution[Array]  # K_N, shape (nv, nv) [1/s]
    contacts: tuple[PlannedContact, ...]
    limits: PlannedLimits
    count: int  # how many tasks there have ever been; the next one has this key
    gravity: Evolution[Array]  # in the world, shape (3,) [m/s²]
    payloads: tuple[PlannedPayload, ...] = ()
    tools: tuple[PlannedTool, ...] = ()

    @property
    def field(self) -> NullSpaceField:
        """The field: the sum of the terms, or the only one if it has weight 1."""
        terms = tuple(term.weighted for term in self.terms)
        if len(terms) == 1 and terms[0].weight == 1.0:
            return terms[0]
        return FieldSum(terms)

    def with_set_numbers(self) -> "Setup":
        """Return the setup in which weights and normal forces are written elsewhere.

        Those that are numbers.
        """
        terms = tuple(_set_weight(each) for each in self.terms)
        contacts = tuple(_set_force(each) for each in self.contacts)
        return replace(self, terms=terms, contacts=contacts)

    @property
    def end(self) -> float:
        """When the last change is complete [s]; -inf without changes."""
        evolutions: list[Evolution[Any]] = [
            self.gain,
            self.gravity,
            *(task.presence for task in self.tasks),
            *(task.gains for task in self.tasks),
            *(term.presence for term in self.terms),
            *(term.weight for term in self.terms if term.weight is not None),
            *(contact.presence for contact in self.contacts),
            *(payload.share for payload in self.payloads),
        ]
        return max(self.limits.end, *(each.end for each in evolutions))

    def instants(self, begin: float) -> Iterator[float]:
        """Yield times from a beginning on at which the active sets differ [s].

        They are those at which a task or a contact may come or go, and some between
        two of them: of several that fade at once, each may have the largest weight.
        """
        events = set[float]()
        for task in self.tasks:
            events |= _events(task.presence, task.task.schedule)
        for contact in self.contacts:
            events |= _events(contact.presence, contact.contact.schedule)
        later = sorted(t for t in events if isfinite(t) and t > begin)
        ordered = [begin, *later][:_MOST]
        for one, following in pairwise(ordered):
            for k in range(_BETWEEN):
                yield one + k / _BETWEEN * (following - one)
        yield ordered[-1]

    @property
    def steady(self) -> bool:
        """Whether tasks and contacts are the same at all times."""
        return all(each.always for each in self.tasks) and all(
            each.always for each in self.contacts
        )

    def task(self, name: str) -> PlannedTask:
        """Return the task that has a name, after all changes so far."""
        present = [each for each in self.tasks if each.presence.target == 1.0]
        return _found("task", name, {each.task.name: each for each in present})

    def present_task(self, name: str, t: float) -> PlannedTask:
        """Return the task of a name that is active at time t [s], or is to come."""
        for each in self.tasks:
            if each.task.name == name and each.presence.at(t) > 0.0:
                return each
        return self.task(name)

    def contact(self, name: str) -> PlannedContact:
        """Return the contact that has a name."""
        there = {each.contact.name: each for each in self.contacts}
        return _found("contact", name, there)

    def with_task(self, planned: PlannedTask, /, **changes: Any) -> "Setup":
        """Return the setup with some attributes of one of its tasks replaced."""
        return replace(self, tasks=_with(self.tasks, planned, changes))

    def with_contact(self, planned: PlannedContact, /, **changes: Any) -> "Setup":
        """Return the setup with some attributes of one of its contacts replaced."""
        return replace(self, contacts=_with(self.contacts, planned, changes))

    def settled(self, t: float) -> "Setup":
        """Return the setup for times from t on: complete changes are folded."""
        tasks = [
            _changed(
                each,
                task=settled(each.task, t),
                presence=each.presence.settled(t),
                gains=each.gains.settled(t),
            )
            for each in self.tasks
        ]
        terms = [each.settled(t) for each in self.terms]
        contacts = [
            _changed(
                each,
                contact=settled(each.contact, t),
                presence=each.presence.settled(t),
            )
            for each in self.contacts
        ]
        tools = [
            _changed(each, placement=settled(each.placement, t)) for each in self.tools
        ]
        payloads = [
            _changed(each, share=each.share.settled(t)) for each in self.payloads
        ]
        return Setup(
            self.start._replace(scene=settled(self.start.scene, t)),
            self.metric,
            tuple(each for each in tasks if each.presence != ABSENT),
            tuple(each for each in terms if each.presence != ABSENT),
            self.gain.settled(t),
            tuple(contacts),
            self.limits.settled(t),
            self.count,
            self.gravity.settled(t),
            tuple(each for each in payloads if each.share != ABSENT),
            tuple(tools),
        )


def _set_weight(term: PlannedTerm) -> PlannedTerm:
    if term.weight is None or not term.field.controls:
        return term
    numbers = np.array([term.weight.target, 0.0])
    return replace(term, field=replace(term.field, weight=SetWeight(numbers)))


def _set_force(planned: PlannedContact) -> PlannedContact:
    force = planned.contact.force
    if force is None or force.trajectory is not None or force.dimension != NORMAL:
        return planned
    numbers = np.array(force.followed.sample(0.0).position)
    set_force = CommandedForce(trajectory=SetPoint(numbers))
    return replace(planned, contact=replace(planned.contact, force=set_force))


def _events(presence: Evolution[float], schedule: Schedule | None) -> set[float]:
    """Return when something begins or ends to come or go [s]."""
    changes = {t for step in presence.transitions for t in (step.start, step.end)}
    if schedule is None:
        return changes
    windows, ramp = schedule.windows, schedule.ramp
    begins = {t for start, _ in windows for t in (start, start + ramp)}
    return changes | begins | {t for _, end in windows for t in (end - ramp, end)}


Planned = TypeVar(
    "Planned", PlannedTask, PlannedTerm, PlannedContact, PlannedPayload, PlannedTool
)


def _found(kind: str, name: str, there: Mapping[str, Planned]) -> Planned:
    if name not in there:
        raise ControllerError(
            f"there is no {kind} {name!r}{did_you_mean(name, there)} "
            f"(there are {listing(there) or 'none'})"
        )
    return there[name]


def _with(
    planned: tuple[Planned, ...], one: Planned, changes: dict[str, Any]
) -> tuple[Planned, ...]:
    return tuple(replace(each, **changes) if each is one else each for each in planned)


def _changed(planned: Planned, **changes: Any) -> Planned:
    """Return it with some attributes replaced, or itself if they are the same."""
    if all(getattr(planned, name) is value for name, value in changes.items()):
        return planned
    return replace(planned, **changes)


def planned_task(key: int, task: Task, presence: Evolution[float]) -> PlannedTask:
    """Return a placed task with its own gains."""
    return PlannedTask(key, task, presence, Evolution(task.in_force().numbers))


def planned_terms(
    field: NullSpaceField, presence: Evolution[float]
) -> tuple[PlannedTerm, ...]:
    """Return the terms of a placed field."""
    return tuple(PlannedTerm(term, presence) for term in terms_of(field))


def levels_of(
    tasks: Sequence[PlannedTask], robot: Robot
) -> tuple[tuple[PlannedTask, ...], ...]:
    """Return the tasks of each level, the highest priority first."""
    levels: dict[int, list[PlannedTask]] = {}
    for each in tasks:
        levels.setdefault(priority_of(each.task, robot), []).append(each)
    return tuple(tuple(levels[priority]) for priority in sorted(levels))


class DeclaredController:
    """What a controller is made of before anything relative in it is placed."""

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task],
        field: NullSpaceField | None,
        null_space_gain: ArrayLike,
        metric: Metric | None,
        singularity_threshold: float,
        limits: Limits | None,
        contacts: Sequence[Contact],
        base: Base | None,
        scene: Scene | Iterable[Obstacle],
        start: ArrayLike | None,
    ) -> None:
        """Check each part by itself; see `Controller` for what they mean."""
        if isinstance(robot, str | Path):
            raise ControllerError(f"robot is {robot!r}; needs Robot.load({robot!r})")
        if isinstance(robot, pin.Model):
            raise ControllerError(
                "robot is a pinocchio.Model; needs Robot.from_pinocchio(model)"
            )
        check_kind("robot is", robot, Robot, ControllerError)
        if not 0.0 < singularity_threshold < np.inf:
            raise ControllerError(
                f"singularity_threshold is {singularity_threshold}; must be positive"
            )
        self.robot, self.limits, self.base = robot, limits, base
        self.threshold = float(singularity_threshold)
        self.field = Rest() if field is None else field
        _check_parts("tasks", tasks, Task)
        self.tasks = tuple(tasks)
        if metric is None:
            yields = any(impedance_of(task) is not None for task in tasks)
            own = MassMatrixMetric(inertia="robot")
            metric = own if yields else IdentityMetric()
        _check_parts("contacts", contacts, Contact)
        self.contacts = tuple(contacts)
        check_kind("field is", self.field, NullSpaceField, ControllerError)
        self.metric: Metric = check_kind("metric is", metric, Metric, ControllerError)
        if limits is not None:
            if limits == "none":
                raise ControllerError("limits is 'none'; in Python it is None")
            check_kind("limits is", limits, Limits, ControllerError)
        self.scene = scene if isinstance(scene, Scene) else Scene(scene)
        # that of the first step where it is None
        self.start = None if start is None else robot.check_configuration(start).copy()
        check_support(robot, contacts, base)
        with within("null_space", "gain"):
            self.gain = as_gain(null_space_gain, "null_space_gain")

    def placed(self, start: Start) -> Setup:
        """Return the setup with all parts placed where the robot starts."""
        robot = self.robot
        tasks = []
        for task in self.tasks:
            with within("tasks", task.name):
                tasks.append(task.placed(start))
        with within("tasks"):
            check_tasks(tasks, robot)
        with within("null_space", "metric"):
            metric = self.metric.placed(start)
        with within("null_space", "gain"):
            gain = checked_gain(self.gain, robot, metric)
        fields = []
        for k, term in enumerate(terms_of(self.field)):
            with within("null_space", "fields", k):
                _refuse_streams(term)
                fields.append(PlannedTerm(term.placed(start), PRESENT))
        contacts = []
        for contact in self.contacts:
            with within("contacts", contact.name):
                contacts.append(PlannedContact(contact.placed(start), PRESENT))
        limits: RobotLimits | None = None
        if self.limits is not None:
            with within("limits"):
                limits = self.limits.placed(start)
        return Setup(
            start,
            metric,
            tuple(planned_task(k, task, PRESENT) for k, task in enumerate(tasks)),
            tuple(fields),
            Evolution(gain),
            tuple(contacts),
            PlannedLimits.of(limits),
            len(tasks),
            Evolution(np.array(robot.model.gravity.linear)),
        )


def _refuse_streams(field: NullSpaceField) -> None:
    """Raise for a field that a stream leads: only that of a change is logged."""
    if any(True for _ in parts_within(field, Streamed)):
        raise FieldError(
            "a stream cannot lead a field from the start; while the controller runs, "
            "controller.at(t).field(...) with a stream does"
        )
