"""Changes of a controller while it runs: the base class, and the kinds of changes."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from typing import Annotated, Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import AfterValidator

from hsp_control.common.errors import ContactError, ControllerError, SceneError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.constraints.contacts import CommandedForce
from hsp_control.constraints.limits import LimitsOrNone, RobotLimits
from hsp_control.control.evolution import ABSENT
from hsp_control.control.fitting import check_tasks, checked_gain
from hsp_control.control.planned import (
    PlannedContact,
    PlannedLimits,
    PlannedTask,
    PlannedTerm,
    planned_task,
    planned_terms,
)
from hsp_control.control.setup import Setup
from hsp_control.declaration import AnyOf, Part, within
from hsp_control.declaration.given import Given
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.quantities import Flag, Gain, NonNegative, Number
from hsp_control.declaration.rotation import AnyRotation
from hsp_control.geometry.scene import Obstacle, Scene, Start
from hsp_control.null_space.fields import FieldSum, NullSpaceField, Rest
from hsp_control.tasks import Gains, Impedance, Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.trajectories import (
    Crossfade,
    OrientationTrajectory,
    PoseTrajectory,
    Trajectory,
    crossfade,
)
from hsp_control.trajectories.pose import AnyPose
from hsp_control.trajectories.streams.stream import stream_for
from hsp_control.trajectories.streams.streamed import Streamed


class Change(Part, ABC, family="changes", error=ControllerError):
    """A change with a start time and a duration; efforts stay continuous.

    Changes apply in the order of their times, whatever the order in which they are
    made. They continue from the values then in force, so that several may overlap. A
    subclass implements `apply`, and `Controller.change` makes it. With a ramp it is an
    `Evolution` of the `Setup`: ``gain``, ``gravity``, and each task's ``gains`` and
    ``presence``; ``setup.gain.then(self.at, self.ramp, target)`` is the next one. All
    else that is replaced acts at once; for a reference apply a `ChangeReference`.
    """

    _: KW_ONLY
    at: Number
    """Its start time [s]; a time that has passed means now."""
    ramp: NonNegative = 0.3
    """Its duration [s]; 0 is a jump."""

    @property
    def end(self) -> float:
        """End time [s]."""
        return self.at + self.ramp

    @abstractmethod
    def apply(self, setup: Setup) -> Setup:
        """Return the setup with this change, after all earlier ones."""

    def understood(self, setup: Setup) -> Self:
        """Return the change with the types that a setup implies: YAML has fewer."""
        return self

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with its parts placed; see `Task.placed`."""
        return self


class ChangeContact(Change, type="contact"):
    """A contact is lifted, or set down again; its force fades.

    While the force is less than a tenth, the motion that the contact stops is set free,
    or stopped, in proportion.
    """

    contact: str
    """Name of the contact."""
    active: Flag
    """Whether it is active from then on."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the contact; see `Change.apply`."""
        planned = _contact(setup, self.contact)
        presence = planned.presence.then(self.at, self.ramp, float(self.active))
        return setup.with_contact(planned, presence=presence)


class ChangeForce(Change, type="force"):
    """The commanded force of a contact changes to another one; C² if both are."""

    contact: str
    """Name of the contact."""
    force: CommandedForce
    """The new command, with as many coordinates as the old one."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change, checked where the robot is."""
        contact = _contact(setup, self.contact).contact
        replace(contact, force=self.force).placed(start)
        return self

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the force; see `Change.apply`."""
        planned = _contact(setup, self.contact)
        contact = planned.contact
        old, new = contact.force, self.force
        with within("force"):
            if old is None:
                raise ContactError(
                    f"contact {self.contact!r} has no commanded force from the start, "
                    "so none can follow; give it one, for example {value: 0}"
                )
            if old.dimension != new.dimension:
                raise ContactError(
                    f"it has {new.dimension} coordinates; the force of contact "
                    f"{self.contact!r} has {old.dimension}"
                )
        changed = Crossfade(
            old.followed, new.followed, start_time=self.at, duration=self.ramp
        )
        following = replace(contact, force=CommandedForce(trajectory=changed))
        return setup.with_contact(planned, contact=following)


class ChangeField(Change, type="field"):
    """The null-space field changes to another one; Proposition 2 holds throughout."""

    fields: Annotated[Sequence[NullSpaceField], AfterValidator(tuple)]
    """The new fields; their sum is used. Without fields, self-motion comes to rest."""

    def placed(self, start: Start, setup: Setup) -> Self:
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
        k = _find_field(setup, self.field)
        term = setup.terms[k]
        if term.weight is None:  # a ramp fades out while the same field fades in
            new = replace(term.field, weight=self.weight)
            return _with_field(setup, k, new, self)
        weight = term.weight.then(self.at, self.ramp, float(self.weight))
        terms = list(setup.terms)
        terms[k] = term.with_weight(weight)
        return replace(setup, terms=tuple(terms))


class ExchangeField(Change, type="exchange_field"):
    """One field is replaced by another one, which keeps its weight; the others stay."""

    field: str
    """Name of the field that goes."""
    by: NullSpaceField
    """The new field; its own weight is ignored."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with its field placed."""
        with within("by"):
            return replace(self, by=self.by.placed(start))

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the other field; see `Change.apply`."""
        k = _find_field(setup, self.field)
        if not self.by.controls:
            raise ControllerError("an uncontrolled null space cannot replace a field")
        new = replace(self.by, weight=setup.terms[k].field.weight)
        return _with_field(setup, k, new, self)


def _task(setup: Setup, name: str) -> PlannedTask:
    """Return the task of a name; an error is at the change's key ``task``."""
    with within("task"):
        return setup.task(name)


def _contact(setup: Setup, name: str) -> PlannedContact:
    """Return the contact of a name; an error is at the change's key ``contact``."""
    with within("contact"):
        return setup.contact(name)


def _find_field(setup: Setup, name: str) -> int:
    """Return the index of the term with a name that is not being removed.

    An error is at the change's key ``field``.
    """
    there = {
        each.field.name: k
        for k, each in enumerate(setup.terms)
        if each.presence.target > 0.0
    }
    if name not in there:
        with within("field"):
            raise ControllerError(
                f"there is no field {name!r}{did_you_mean(name, there)} "
                f"(there are {listing(there) or 'none'})"
            )
    return there[name]


def _with_field(setup: Setup, index: int, new: NullSpaceField, change: Change) -> Setup:
    """Return the setup in which a term fades out while another one fades in."""
    terms, at, ramp = list(setup.terms), change.at, change.ramp
    old = terms[index]
    terms[index] = PlannedTerm(old.field, old.presence.then(at, ramp, 0.0))
    terms.append(PlannedTerm(new, ABSENT.then(at, ramp, 1.0)))
    return replace(setup, terms=tuple(terms))


class AddTask(Change, type="add_task"):
    """A task is added; it fades in."""

    task: Task
    """The task; relative values in it refer to the robot's pose when the change
    is made."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with its task placed."""
        with within("task"):
            return replace(self, task=self.task.placed(start))

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the task; see `Change.apply`."""
        there = [each.task for each in setup.tasks if each.stays]
        with within("task"):
            check_tasks([*there, self.task], setup.start.state.robot)
        presence = ABSENT.then(self.at, self.ramp, 1.0)
        added = planned_task(setup.count, self.task, presence)
        return replace(setup, tasks=(*setup.tasks, added), count=setup.count + 1)


class RemoveTask(Change, type="remove_task"):
    """A task is removed; it fades out, and one that is added meanwhile fades in.

    With equal times and ramps they exchange: the effort is the mean of both, so that
    what both tasks control keeps its error equation.
    """

    task: str
    """Name of the task."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup without the task; see `Change.apply`."""
        planned = _task(setup, self.task)
        gone = planned.departure.then(self.at, self.ramp, 1.0)
        return setup.with_task(planned, departure=gone)


class ChangeGains(Change, type="gains"):
    """The gains of a task change; its error equation holds throughout."""

    task: str
    """Name of the task."""
    gains: Gains
    """The new gains."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the gains; see `Change.apply`."""
        planned = _task(setup, self.task)
        with within("task"):
            if planned.task.order != 2:
                raise ControllerError(
                    f"{self.task!r} has no gains: its error equation is of first order"
                )
            if impedance_of(planned.task) is not None:
                raise ControllerError(
                    f"{self.task!r} has an impedance instead of gains; a change of "
                    "type impedance changes it"
                )
        with within("gains"):
            target = np.stack(self.gains.matrices(planned.task.rows))
        gains = planned.gains.then(self.at, self.ramp, target)
        return setup.with_task(planned, gains=gains)


class ChangeImpedance(Change, type="impedance"):
    """The impedance of a task changes; its equation holds throughout.

    While the stiffness K changes, it adds the power ½ eᵀK'e to the motion. Where
    efforts are held for a period, the change waits while that is more than the damping
    takes out: a hand that is held away from its target becomes stiffer when it moves.
    """

    task: str
    """Name of the task."""
    impedance: Impedance
    """The new impedance."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with the spring's largest force in numbers."""
        task = _task(setup, self.task).task
        with within("impedance"):
            impedance = self.impedance.placed(task.error_parts, start.state.robot)
        return replace(self, impedance=impedance)

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the impedance; see `Change.apply`."""
        planned = _task(setup, self.task)
        if impedance_of(planned.task) is None:
            with within("task"):
                raise ControllerError(
                    f"{self.task!r} has no impedance from the start, so none can "
                    "follow; give it one"
                )
        with within("impedance"):
            target = self.impedance.numbers(planned.task.error_parts)
            numbers = planned.gains.then(self.at, self.ramp, target)
        return setup.with_task(planned, gains=numbers)


class ChangeReference(Change, type="reference"):
    """The trajectory of a task changes to another one; C² if both are."""

    task: str
    """Name of the task."""
    trajectory: Given[
        Annotated[
            Trajectory | OrientationTrajectory | PoseTrajectory,
            AnyOf(PoseTrajectory, Trajectory, OrientationTrajectory),
        ],
        AnyRotation | AnyPose,
    ]
    """The new trajectory, in the task's unit; relative values in it refer to
    the robot's pose when the change is made."""

    def understood(self, setup: Setup) -> Self:
        """Return the change with a stream of the task's kind: YAML has one word."""
        if not isinstance(self.trajectory, Streamed):
            return self
        followed = _task(setup, self.task).task.followed
        with within("trajectory"):
            stream = stream_for(followed, self.trajectory)
        return self if stream is self.trajectory else replace(self, trajectory=stream)

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with its trajectory in the world."""
        task = _task(setup, self.task).task
        with within("trajectory"):
            following = task.following(self.trajectory)
        followed = following.placed(start).followed
        assert followed is not None
        return replace(self, trajectory=followed)

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the trajectory; see `Change.apply`."""
        planned = _task(setup, self.task)
        task = planned.task
        assert task.followed is not None
        changed = crossfade(
            task.followed, self.trajectory, start_time=self.at, duration=self.ramp
        )
        return setup.with_task(planned, task=task.following(changed))


class ChangeNullSpaceGain(Change, type="null_space_gain"):
    """The null-space gain K_N changes; V decays throughout."""

    gain: Gain
    """The new gain [1/s]: a number, nv numbers, or a matrix; over a metric that changes
    with q, one number."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the gain; see `Change.apply`."""
        with within("gain"):
            target = checked_gain(self.gain, setup.start.state.robot, setup.metric)
        return replace(setup, gain=setup.gain.then(self.at, self.ramp, target))


class MoveObstacle(Change, type="obstacle"):
    """An obstacle leaves its trajectory for another one; C² if both are."""

    obstacle: str
    """Name of the obstacle in the scene."""
    center: Given[Trajectory, ArrayLike]
    """The new trajectory of its frame's origin in the world [m]; a stream begins where
    the obstacle is."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with a stream that begins where the obstacle is."""
        if not any(True for _ in parts_within(self.center, Streamed)):
            return self
        with within("obstacle"):
            old = setup.start.scene[self.obstacle]
        here = old.center.sample(max(self.at, start.state.t)).position
        with within("center"):
            return replace(self, center=self.center.anchored(here))

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the obstacle at all its uses; see `Change.apply`."""
        scene = setup.start.scene
        with within("obstacle"):
            old = scene[self.obstacle]
        with within("center"):
            if (count := self.center.dimension) != 3:
                raise SceneError(f"its dimension is {count}; needs 3 (x, y, z)")
        center = Crossfade(
            old.center, self.center, start_time=self.at, duration=self.ramp
        )
        new = replace(old, center=center)
        moved = Scene([new if each is old else each for each in scene.values()])
        terms = tuple(
            replace(each, field=_exchanged(each.field, old, new))
            for each in setup.terms
        )
        sets = tuple(
            (limits and _elsewhere(limits, old, new), share)
            for limits, share in setup.limits.sets
        )
        return replace(
            setup,
            start=setup.start._replace(scene=moved),
            terms=terms,
            limits=PlannedLimits(sets),
        )


Holder = TypeVar("Holder", bound=Part)


def _exchanged(part: Holder, old: Obstacle, new: Obstacle) -> Holder:
    """Return a part in which one obstacle is replaced by another one."""
    changes: dict[str, Any] = {}
    for name, value in part.all_fields().items():
        if _is(value, old):
            changes[name] = new
        elif isinstance(value, tuple) and any(_is(each, old) for each in value):
            changes[name] = tuple(new if _is(each, old) else each for each in value)
    return replace(part, **changes) if changes else part  # type: ignore[type-var]


def _elsewhere(limits: RobotLimits, old: Obstacle, new: Obstacle) -> RobotLimits:
    """Return limits in which one obstacle is replaced by another one."""
    if not limits.barriers:
        return limits
    moved = tuple(_exchanged(each, old, new) for each in limits.barriers)
    return replace(limits, barriers=moved)


def _is(value: object, obstacle: Obstacle) -> bool:
    # Not `==` alone: values that hold arrays have no truth of being equal.
    return isinstance(value, Obstacle) and (value is obstacle or value == obstacle)


class ChangeLimits(Change, type="limits"):
    """The limits change to other ones.

    Meanwhile efforts are (1 - s) times those within the old limits plus s times those
    within the new ones, s from 0 to 1 and C² in time. So no effort jumps where a limit
    goes, or one comes that the robot violates.
    """

    limits: LimitsOrNone
    """The new limits; none: the old ones go. Without a bandwidth they keep that of the
    old ones."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the limits; see `Change.apply`."""
        with within("limits"):
            new, old = self.limits, setup.limits.last
            if new is not None and new.bandwidth is None and old is not None:
                new = replace(new, bandwidth=old.bandwidth)
            numbers = None if new is None else new.placed(setup.start)
            limits = setup.limits.then(self.at, self.ramp, numbers)
        return replace(setup, limits=limits)
