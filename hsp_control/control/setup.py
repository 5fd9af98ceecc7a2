"""All parts of a controller as a function of time."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import pairwise
from math import isfinite
from typing import Any, TypeVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.constraints.contacts import CommandedForce
from hsp_control.control.evolution import ABSENT, Evolution
from hsp_control.control.model_in_force import PlannedPayload
from hsp_control.control.planned import (
    PlannedContact,
    PlannedLimits,
    PlannedTask,
    PlannedTerm,
    changed,
)
from hsp_control.control.tools_in_force import PlannedTool
from hsp_control.geometry.scene import Start
from hsp_control.null_space.fields import FieldSum, NullSpaceField
from hsp_control.null_space.fields.weight import Ramp, SetWeight
from hsp_control.null_space.metrics import Metric
from hsp_control.trajectories.crossfade import settled
from hsp_control.trajectories.hold import SetPoint
from hsp_control.trajectories.schedule import Schedule

_MOST = 500
"""Number of events that are considered: a schedule may repeat for hours."""
_BETWEEN = 6
"""Number of sample times between two of them."""
_AFTER = 1e-6
"""Time after the last one that is sampled, beyond rounding of its end [s]."""


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
        """Return the setup in which weights and commanded forces are written elsewhere.

        Those that are numbers; of a weight that is a ramp, a factor is.
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
            *(task.departure for task in self.tasks),
            *(task.gains for task in self.tasks),
            *(term.presence for term in self.terms),
            *(term.weight for term in self.terms if term.weight is not None),
            *(contact.presence for contact in self.contacts),
            *(payload.share for payload in self.payloads),
        ]
        return max(self.limits.end, *(each.end for each in evolutions))

    def instants(self, begin: float) -> Iterator[float]:
        """Yield times from a beginning on at which the active sets differ [s].

        They are those at which a task, a contact or limits may come or go, and some
        between two of them: of several that fade at once, each may have the largest
        weight.
        """
        events = set[float]()
        for task in self.tasks:
            events |= _events(task.presence, task.task.schedule)
            events |= _events(task.departure, None)
        for contact in self.contacts:
            events |= _events(contact.presence, contact.contact.schedule)
        for _, share in self.limits.sets:
            events |= _events(share, None)
        later = sorted(t for t in events if isfinite(t) and t > begin)
        ordered = [begin, *later][:_MOST]
        for one, following in pairwise(ordered):
            for k in range(_BETWEEN):
                yield one + k / _BETWEEN * (following - one)
        yield ordered[-1] + _AFTER

    @property
    def steady(self) -> bool:
        """Whether tasks and contacts are the same at all times."""
        return all(each.always for each in self.tasks) and all(
            each.always for each in self.contacts
        )

    def task(self, name: str) -> PlannedTask:
        """Return the task that has a name, after all changes so far."""
        present = [each for each in self.tasks if each.stays]
        return _found("task", name, {each.task.name: each for each in present})

    def present_task(self, name: str, t: float) -> PlannedTask:
        """Return the newest task of a name that is active at time t [s], or will be."""
        for each in reversed(self.tasks):
            if each.task.name == name and each.present(t):
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
            changed(
                each,
                task=settled(each.task, t),
                presence=each.presence.settled(t),
                gains=each.gains.settled(t),
                departure=each.departure.settled(t),
            )
            for each in self.tasks
        ]
        terms = [each.settled(t) for each in self.terms]
        contacts = [
            changed(
                each,
                contact=settled(each.contact, t),
                presence=each.presence.settled(t),
            )
            for each in self.contacts
        ]
        tools = [
            changed(each, placement=settled(each.placement, t)) for each in self.tools
        ]
        payloads = [
            changed(each, share=each.share.settled(t)) for each in self.payloads
        ]
        return Setup(
            self.start._replace(scene=settled(self.start.scene, t)),
            self.metric,
            tuple(each for each in tasks if not each.gone),
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
    own, known = term.field.weight, term.weight
    if not term.field.controls or (known is None and type(own) is not Ramp):
        return term
    numbers = np.array([1.0 if known is None else known.target, 0.0])
    weight = SetWeight(numbers, own if type(own) is Ramp else None)
    return replace(term, field=replace(term.field, weight=weight))


def _set_force(planned: PlannedContact) -> PlannedContact:
    force = planned.contact.force
    if force is None or force.trajectory is not None:
        return planned
    numbers = np.array(force.followed.sample(0.0).position)
    set_force = CommandedForce(trajectory=SetPoint(numbers))
    return replace(planned, contact=replace(planned.contact, force=set_force))


def _events(presence: Evolution[float], schedule: Schedule | None) -> set[float]:
    """Return the start and end times of all transitions [s]."""
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
