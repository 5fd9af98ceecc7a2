"""Changes of a controller while it runs: events on one time line."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, replace
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator

from hsp_control.common.exceptions import ControllerError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.control.composition import check_tasks, checked_gain
from hsp_control.control.evolution import ABSENT
from hsp_control.control.setup import (
    PlannedTerm,
    Setup,
    planned_task,
    planned_terms,
)
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import Flag, Gain, NonNegative, Number
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields import FieldSum, NullSpaceField, Rest
from hsp_control.tasks import Gains, Task


class Change(Part, ABC, family="changes", error=ControllerError):
    """A change that begins at a time and takes a while; efforts stay continuous.

    Changes count in the order of their times, whatever the order in which they are
    made. Each continues from what is then in force, so that several may overlap. A
    subclass implements `apply`.
    """

    _: KW_ONLY
    at: Number
    """When it begins [s]; a time that has passed means now."""
    ramp: NonNegative = 0.3
    """How long it takes [s]; 0 is a jump."""

    @abstractmethod
    def apply(self, setup: Setup) -> Setup:
        """Return the setup with this change, after all earlier ones.

        Raises:
            ControllerError: If it names something that does not exist then.
        """

    def placed(self, start: Start) -> Self:
        """Return the change with its parts placed; see `Task.placed`."""
        return self


class AddTask(Change, type="add_task"):
    """A task is added; it fades in."""

    task: Task
    """The task; what is relative in it counts from where the robot is when the change
    is made."""

    def placed(self, start: Start) -> Self:
        """Return the change with its task placed."""
        with within("task"):
            return replace(self, task=self.task.placed(start))

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the task; see `Change.apply`."""
        there = [each.task for each in setup.tasks if each.presence.target == 1.0]
        check_tasks([*there, self.task], setup.start.state.robot)
        key = 1 + max((each.key for each in setup.tasks), default=-1)
        presence = ABSENT.then(self.at, self.ramp, 1.0)
        added = planned_task(key, self.task, presence)
        return replace(setup, tasks=(*setup.tasks, added))


class RemoveTask(Change, type="remove_task"):
    """A task is removed; it fades out."""

    task: str
    """Name of the task."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup without the task; see `Change.apply`."""
        k = setup.find_task(self.task)
        gone = setup.tasks[k].presence.then(self.at, self.ramp, 0.0)
        return setup.with_task(k, presence=gone)


class ChangeGains(Change, type="gains"):
    """The gains of a task change; its error equation holds throughout."""

    task: str
    """Name of the task."""
    gains: Gains
    """The new gains."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the gains; see `Change.apply`.

        Raises:
            GainError: If the gains do not fit the task.
        """
        k = setup.find_task(self.task)
        planned = setup.tasks[k]
        if planned.task.order != 2:
            raise ControllerError(
                f"task {self.task!r} has no gains: its error equation is of first order"
            )
        with within("gains"):
            target = np.stack(self.gains.matrices(planned.task.rows))
        return setup.with_task(k, gains=planned.gains.then(self.at, self.ramp, target))


class ChangeField(Change, type="field"):
    """The null-space field changes to another one; Proposition 2 holds throughout."""

    fields: Annotated[Sequence[NullSpaceField], AfterValidator(tuple)]
    """The new fields; their sum is used. Without fields, self-motion comes to rest."""

    def placed(self, start: Start) -> Self:
        """Return the change with its fields placed."""
        placed = []
        for k, field in enumerate(self.fields):
            with within("fields", k):
                placed.append(field.placed(start))
        return replace(self, fields=placed)

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the field; see `Change.apply`."""
        old = [
            PlannedTerm(each.field, each.presence.then(self.at, self.ramp, 0.0))
            for each in setup.terms
        ]
        fields = self.fields or (Rest(),)
        sum_of = fields[0] if len(fields) == 1 else FieldSum(fields)
        new = planned_terms(sum_of, ABSENT.then(self.at, self.ramp, 1.0))
        if not all(each.field.controls for each in (*old, *new)):
            raise ControllerError(
                "an uncontrolled null space cannot be blended with a controlled one"
            )
        return replace(setup, terms=(*old, *new))


class ChangeWeight(Change, type="weight"):
    """The weight of one field changes."""

    field: str
    """Name of the field."""
    weight: NonNegative
    """The new weight [-]."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the weight; see `Change.apply`."""
        there = {
            each.field.name: k
            for k, each in enumerate(setup.terms)
            if each.presence.target > 0.0
        }
        if self.field not in there:
            raise ControllerError(
                f"there is no field {self.field!r}{did_you_mean(self.field, there)} "
                f"(there are {listing(there)})"
            )
        terms, k = list(setup.terms), there[self.field]
        old = terms[k]
        # The old weight fades out, and the same field fades in with the new weight:
        # so weights that are ramps or functions of the state work alike.
        terms[k] = PlannedTerm(old.field, old.presence.then(self.at, self.ramp, 0.0))
        new = replace(old.field, weight=self.weight)
        terms.append(PlannedTerm(new, ABSENT.then(self.at, self.ramp, 1.0)))
        return replace(setup, terms=tuple(terms))


class ChangeNullSpaceGain(Change, type="null_space_gain"):
    """The null-space gain K_N changes; V decays throughout."""

    gain: Gain
    """The new gain [1/s]: a number, nv numbers, or a matrix."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the gain; see `Change.apply`."""
        with within("gain"):
            target = checked_gain(self.gain, setup.start.state.robot, setup.metric)
        return replace(setup, gain=setup.gain.then(self.at, self.ramp, target))


class ChangeContact(Change, type="contact"):
    """A contact is lifted, or set down again; its force fades."""

    contact: str
    """Name of the contact."""
    bears: Flag
    """Whether it bears from then on."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the contact; see `Change.apply`."""
        there = {each.contact.name: k for k, each in enumerate(setup.contacts)}
        if self.contact not in there:
            raise ControllerError(
                f"there is no contact {self.contact!r}"
                f"{did_you_mean(self.contact, there)} (there are {listing(there)})"
            )
        contacts, k = list(setup.contacts), there[self.contact]
        presence = contacts[k].presence.then(self.at, self.ramp, float(self.bears))
        contacts[k] = replace(contacts[k], presence=presence)
        return replace(setup, contacts=tuple(contacts))


class Changes:
    """Makes changes that begin at one time: what `Controller.at` returns.

    Each method makes one change and returns the object, so that calls can be chained::

        controller.at(1.0).ramp(0.5).gains("hand", stiffer).remove("posture")
    """

    def __init__(
        self, make: Callable[[Change], object], at: float, ramp: float = 0.3
    ) -> None:
        """Set when the changes begin, and how long they take [s]."""
        self._make, self._at, self._ramp = make, at, ramp

    def ramp(self, duration: float) -> "Changes":
        """Return the same with another duration of the changes [s]."""
        return Changes(self._make, self._at, duration)

    def add(self, task: Task) -> Self:
        """Add a task; see `AddTask`."""
        return self._do(AddTask(task, at=self._at, ramp=self._ramp))

    def remove(self, task: str) -> Self:
        """Remove a task; see `RemoveTask`."""
        return self._do(RemoveTask(task, at=self._at, ramp=self._ramp))

    def gains(self, task: str, gains: Gains) -> Self:
        """Change the gains of a task; see `ChangeGains`."""
        return self._do(ChangeGains(task, gains, at=self._at, ramp=self._ramp))

    def field(self, *fields: NullSpaceField) -> Self:
        """Change to another field, or to the sum of several; see `ChangeField`."""
        return self._do(ChangeField(fields, at=self._at, ramp=self._ramp))

    def weight(self, field: str, weight: float) -> Self:
        """Change the weight of a field; see `ChangeWeight`."""
        return self._do(ChangeWeight(field, weight, at=self._at, ramp=self._ramp))

    def null_space_gain(self, gain: Gain) -> Self:
        """Change the null-space gain; see `ChangeNullSpaceGain`."""
        return self._do(ChangeNullSpaceGain(gain, at=self._at, ramp=self._ramp))

    def contact(self, contact: str, *, bears: bool) -> Self:
        """Lift a contact, or set it down; see `ChangeContact`."""
        return self._do(ChangeContact(contact, bears, at=self._at, ramp=self._ramp))

    def _do(self, change: Change) -> Self:
        self._make(change)
        return self
