"""Tasks, fields, contacts and limits, and when they are part of a controller."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import RobotLimits
from hsp_control.control.evolution import (
    ABSENT,
    PRESENT,
    Evolution,
    EvolvingWeight,
)
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.fields.weight import ConstantWeight, Weight, product
from hsp_control.tasks import Task
from hsp_control.trajectories.crossfade import settled


@dataclass(frozen=True)
class PlannedTask:
    """A task, its activity in time, and its gains."""

    key: int  # unique, also among tasks of the same name
    task: Task  # placed
    presence: Evolution[float]  # from 0 to 1 while it becomes part of the controller
    # numbers of its feedback: Kp and Kv, shape (2, m, m) [1/s², 1/s], or those of an
    # impedance; see `Task.in_force`
    gains: Evolution[Array]
    departure: Evolution[float] = ABSENT  # from 0 to 1 while it is removed

    @property
    def unscheduled(self) -> bool:
        """Whether only changes activate it."""
        return self.task.schedule is None

    @property
    def stays(self) -> bool:
        """Whether it is there after all changes."""
        return self.presence.target == 1.0 and self.departure.target == 0.0

    @property
    def gone(self) -> bool:
        """Whether it is not there, and will not be."""
        return self.presence == ABSENT or self.departure == PRESENT

    def present(self, t: float) -> bool:
        """Return whether it is part of the controller at time t [s], also in part."""
        return self.presence.at(t) > self.departure.at(t)

    def interval_calls(self, low: Array, high: Array) -> PartCalls:
        """Return the calls that write `interval` where it is unscheduled, shapes (1,).

        Before them both are zero.
        """
        gone = [] if self.departure.constant else [self.departure.call(low)]
        return [self.presence.call(high), *gone]

    def interval(self, t: float) -> tuple[float, float]:
        """Return the interval in (0, 1) where it is active at time t: see `Mixture`."""
        schedule = self.task.schedule
        low, high = (0.0, 1.0) if schedule is None else schedule.interval(t)
        return max(low, self.departure.at(t)), high * self.presence.at(t)

    def weight(self, t: float) -> float:
        """Return the weight of the task at time t [s], in [0, 1]."""
        low, high = self.interval(t)
        return max(high - low, 0.0)

    def weight_beyond(self, t: float, edges: Sequence[float]) -> float:
        """Return its weight at time t where some contacts are lifted.

        A task without a ramp that begins where a contact ends moves the link that the
        contact held. So it is active before, with the complementary weight; so is
        one that ends where a contact begins.
        """
        now, schedule = self.weight(t), self.task.schedule
        if schedule is None or schedule.ramp or 0.0 < now < 1.0:
            return now
        whole = max(self.presence.at(t) - self.departure.at(t), 0.0)
        there = (whole * schedule.weight(x) for x in edges)
        return next((each for each in there if each != now), now)

    @property
    def always(self) -> bool:
        """Whether its weight is 1 at all times."""
        schedule = self.task.schedule
        unscheduled = schedule is None or (schedule.constant and not schedule.ramp)
        stays = self.presence == PRESENT and self.departure == ABSENT
        return unscheduled and stays


@dataclass(frozen=True)
class PlannedTerm:
    """A term of the field, and its activity in time."""

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
        """Return the term with another weight."""
        own = weight.initial if weight.constant else EvolvingWeight(weight)
        return replace(self, field=replace(self.field, weight=own))

    def settled(self, t: float) -> "PlannedTerm":
        """Return the term for times from t on: complete changes are folded."""
        field, presence = settled(self.field, t), self.presence.settled(t)
        term = changed(self, field=field, presence=presence)
        weight = term.weight
        if weight is None or (later := weight.settled(t)) is weight:
            return term
        return term.with_weight(later)


def planned_task(key: int, task: Task, presence: Evolution[float]) -> PlannedTask:
    """Return a placed task with its own gains."""
    return PlannedTask(key, task, presence, Evolution(task.in_force().numbers))


def planned_terms(
    field: NullSpaceField, presence: Evolution[float]
) -> tuple[PlannedTerm, ...]:
    """Return the terms of a placed field."""
    return tuple(PlannedTerm(term, presence) for term in terms_of(field))


HELD = 0.1
"""Weight from which on a contact is kept at rest. With 1, a foot would move while it is
active; with 0, its motion would be released, or stopped, with a jump."""


@dataclass(frozen=True)
class PlannedContact:
    """A contact, and its activity in time."""

    contact: Contact
    presence: Evolution[float]  # 1 while it is active, 0 while it is lifted

    @property
    def always(self) -> bool:
        """Whether the contact is active at all times."""
        return self.contact.always and self.presence == PRESENT

    @property
    def unscheduled(self) -> bool:
        """Whether only changes activate it."""
        return self.contact.schedule is None

    def interval_calls(self, low: Array, high: Array) -> PartCalls:
        """Return the calls that write 0 and `share` where it is unscheduled, (1,).

        Before them both are zero.
        """
        weight = np.zeros(1)
        given = {"weight": weight, "held": HELD, "share": high}
        return [self.presence.call(weight), PartCall(engine.FadingContact, **given)]

    def active(self, t: float) -> bool:
        """Return whether the contact is kept at rest at time t [s]."""
        return self.contact.active(t) and self.presence.at(t) > 0.0

    def weight(self, t: float) -> float:
        """Return its share at time t [s], in [0, 1]."""
        return self.contact.weight(t) * self.presence.at(t)

    def share(self, t: float) -> float:
        """Return the degree to which it is kept at rest at time t [s], in [0, 1]."""
        # It is 1 - (1 - x)³ with x the weight over `HELD`: C² in time, as the weight.
        if not self.active(t):
            return 0.0
        x = min(self.weight(t) / HELD, 1.0)
        return x * (3.0 - x * (3.0 - x))

    def edge(self, t: float) -> float:
        """Return the time near t of a lift, or of the last one, by its schedule [s]."""
        schedule = self.contact.schedule
        return t if schedule is None else schedule.edge(t)


@dataclass(frozen=True)
class PlannedLimits:
    """The limits of a controller: consecutive sets.

    While one follows another, both are active, and their results are mixed; see
    `Mixture.step`. So a limit can be removed or added smoothly.
    """

    # each set of limits, None for none, in order of time; and its share, in [0, 1]. The
    # sum of the shares is 1.
    sets: tuple[tuple[RobotLimits | None, Evolution[float]], ...]

    @classmethod
    def of(cls, limits: RobotLimits | None) -> "PlannedLimits":
        """Return limits that do not change."""
        return cls(((limits, PRESENT),))

    @property
    def last(self) -> RobotLimits | None:
        """The limits after all changes."""
        return self.sets[-1][0]

    @property
    def end(self) -> float:
        """When the last change is complete [s]; -inf without changes."""
        return max(share.end for _, share in self.sets)

    def then(
        self, start: float, ramp: float, limits: RobotLimits | None
    ) -> "PlannedLimits":
        """Return the limits with a change to other ones."""
        before = [(each, share.then(start, ramp, 0.0)) for each, share in self.sets]
        return PlannedLimits((*before, (limits, ABSENT.then(start, ramp, 1.0))))

    def settled(self, t: float) -> "PlannedLimits":
        """Return the limits for times from t on: complete changes are folded."""
        folded = [(_settled(each, t), share.settled(t)) for each, share in self.sets]
        return PlannedLimits(tuple(pair for pair in folded if pair[1] != ABSENT))


def _settled(limits: RobotLimits | None, t: float) -> RobotLimits | None:
    """Return limits whose obstacles move as they do from a time on [s]."""
    if limits is None:
        return None
    barriers = settled(limits.barriers, t)
    same = barriers is limits.barriers
    return limits if same else replace(limits, barriers=barriers)


Planned = TypeVar("Planned")


def changed(planned: Planned, **changes: Any) -> Planned:
    """Return it with some attributes replaced, or itself if they are the same."""
    if all(getattr(planned, name) is value for name, value in changes.items()):
        return planned
    new: Planned = replace(planned, **changes)  # type: ignore[type-var]
    return new
