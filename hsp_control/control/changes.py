"""Changes of a controller while it runs: events on one time line."""

from collections.abc import Callable
from dataclasses import replace
from typing import Annotated, Any, Self, TypeVar

import numpy as np

from hsp_control.common.exceptions import ControllerError
from hsp_control.constraints.contacts import CommandedForce
from hsp_control.constraints.limits import Limits, LimitsOrNone, RobotLimits
from hsp_control.control.change import Change
from hsp_control.control.composition import check_tasks, checked_gain
from hsp_control.control.contact_changes import ChangeContact, ChangeForce
from hsp_control.control.evolution import ABSENT
from hsp_control.control.field_changes import ChangeField, ChangeWeight, ExchangeField
from hsp_control.control.planned_limits import PlannedLimits
from hsp_control.control.setup import (
    Setup,
    planned_task,
)
from hsp_control.declaration import AnyOf, Part, within
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.quantities import Gain
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.tasks import Gains, Impedance, Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.impedance import check_bounded, parts_of
from hsp_control.trajectories import (
    Crossfade,
    OrientationTrajectory,
    PoseTrajectory,
    Trajectory,
    crossfade,
)
from hsp_control.trajectories.crossfade import AnyReference
from hsp_control.trajectories.streams.stream import (
    Streamed,
    stream_for,
)

__all__ = [
    "AddTask",
    "Change",
    "ChangeContact",
    "ChangeField",
    "ChangeForce",
    "ChangeGains",
    "ChangeImpedance",
    "ChangeLimits",
    "ChangeNullSpaceGain",
    "ChangeReference",
    "ChangeWeight",
    "Changes",
    "ExchangeField",
    "MoveObstacle",
    "RemoveTask",
]


class AddTask(Change, type="add_task"):
    """A task is added; it fades in."""

    task: Task
    """The task; what is relative in it counts from where the robot is when the change
    is made."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with its task placed."""
        with within("task"):
            return replace(self, task=self.task.placed(start))

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the task; see `Change.apply`."""
        there = [each.task for each in setup.tasks if each.presence.target == 1.0]
        check_tasks([*there, self.task], setup.start.state.robot)
        presence = ABSENT.then(self.at, self.ramp, 1.0)
        added = planned_task(setup.count, self.task, presence)
        return replace(setup, tasks=(*setup.tasks, added), count=setup.count + 1)


class RemoveTask(Change, type="remove_task"):
    """A task is removed; it fades out."""

    task: str
    """Name of the task."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup without the task; see `Change.apply`."""
        planned = setup.task(self.task)
        gone = planned.presence.then(self.at, self.ramp, 0.0)
        return setup.with_task(planned, presence=gone)


class ChangeGains(Change, type="gains"):
    """The gains of a task change; its error equation holds throughout."""

    task: str
    """Name of the task."""
    gains: Gains
    """The new gains."""

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the gains; see `Change.apply`."""
        planned = setup.task(self.task)
        if planned.task.order != 2:
            raise ControllerError(
                f"task {self.task!r} has no gains: its error equation is of first order"
            )
        if impedance_of(planned.task) is not None:
            raise ControllerError(
                f"task {self.task!r} has an impedance instead of gains; a change of "
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
        task = setup.task(self.task).task
        with within("impedance"):
            impedance = self.impedance.placed(task.error_parts, start.state.robot)
        return replace(self, impedance=impedance)

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the impedance; see `Change.apply`."""
        planned = setup.task(self.task)
        if impedance_of(planned.task) is None:
            raise ControllerError(
                f"task {self.task!r} has no impedance from the start, so none can "
                "follow; give it one"
            )
        with within("impedance"):
            target = self.impedance.numbers(planned.task.error_parts)
            numbers = planned.gains.then(self.at, self.ramp, target)
            values = [numbers.initial, *(each.target for each in numbers.transitions)]
            # In between, the stiffness of one meets the bounds of another.
            if any(parts_of(each)[3].any() for each in values):
                for each in values:
                    check_bounded(parts_of(each)[0])
        return setup.with_task(planned, gains=numbers)


class ChangeReference(Change, type="reference"):
    """The trajectory of a task changes to another one; C² if both are."""

    task: str
    """Name of the task."""
    trajectory: Annotated[
        Trajectory | OrientationTrajectory | PoseTrajectory,
        AnyOf(PoseTrajectory, Trajectory, OrientationTrajectory),
    ]
    """The new trajectory, in the task's unit; what is relative in it counts from where
    the robot is when the change is made."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with its trajectory in the world."""
        task = setup.task(self.task).task
        trajectory = self.trajectory
        if isinstance(trajectory, Streamed):  # YAML has one word for all kinds
            with within("trajectory"):
                trajectory = stream_for(task.followed, trajectory)
        followed = task.following(trajectory).placed(start).followed
        assert followed is not None
        return replace(self, trajectory=followed)

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the trajectory; see `Change.apply`."""
        planned = setup.task(self.task)
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
    center: Trajectory
    """The new trajectory of its frame's origin in the world [m]; a stream begins where
    the obstacle is."""

    def placed(self, start: Start, setup: Setup) -> Self:
        """Return the change with a stream that begins where the obstacle is."""
        if not any(True for _ in parts_within(self.center, Streamed)):
            return self
        with within("obstacle"):
            old = setup.start.scene[self.obstacle]
        here = old.center.sample(max(self.at, start.state.t)).position
        return replace(self, center=self.center.anchored(here))

    def apply(self, setup: Setup) -> Setup:
        """Return the setup with the obstacle wherever it counts; see `Change.apply`."""
        scene = setup.start.scene
        with within("obstacle"):
            old = scene[self.obstacle]
        center = Crossfade(
            old.center, self.center, start_time=self.at, duration=self.ramp
        )
        new = replace(old, center=center)
        moved = Scene([new if each == old else each for each in scene.values()])
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
    if not limits.distances:
        return limits
    moved = tuple(_exchanged(each, old, new) for each in limits.distances)
    return replace(limits, distances=moved)


def _is(value: object, obstacle: Obstacle) -> bool:
    # Not `==` alone: values that hold arrays have no truth of being equal.
    return isinstance(value, Obstacle) and value == obstacle


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

    def impedance(self, task: str, impedance: Impedance) -> Self:
        """Change the impedance of a task; see `ChangeImpedance`."""
        at, ramp = self._at, self._ramp
        return self._do(ChangeImpedance(task, impedance, at=at, ramp=ramp))

    def reference(self, task: str, trajectory: AnyReference) -> Self:
        """Change the trajectory of a task; see `ChangeReference`."""
        at, ramp = self._at, self._ramp
        return self._do(ChangeReference(task, trajectory, at=at, ramp=ramp))

    def field(self, *fields: NullSpaceField) -> Self:
        """Change to another field, or to the sum of several; see `ChangeField`."""
        return self._do(ChangeField(fields, at=self._at, ramp=self._ramp))

    def weight(self, field: str, weight: float) -> Self:
        """Change the weight of a field; see `ChangeWeight`."""
        return self._do(ChangeWeight(field, weight, at=self._at, ramp=self._ramp))

    def exchange(self, field: str, by: NullSpaceField) -> Self:
        """Replace one field by another one; see `ExchangeField`."""
        return self._do(ExchangeField(field, by, at=self._at, ramp=self._ramp))

    def null_space_gain(self, gain: Gain) -> Self:
        """Change the null-space gain; see `ChangeNullSpaceGain`."""
        return self._do(ChangeNullSpaceGain(gain, at=self._at, ramp=self._ramp))

    def obstacle(self, obstacle: str, center: Trajectory) -> Self:
        """Move an obstacle on another trajectory; see `MoveObstacle`."""
        return self._do(MoveObstacle(obstacle, center, at=self._at, ramp=self._ramp))

    def limits(self, limits: Limits | None) -> Self:
        """Change the limits; see `ChangeLimits`."""
        return self._do(ChangeLimits(limits, at=self._at, ramp=self._ramp))

    def contact(self, contact: str, *, bears: bool) -> Self:
        """Lift a contact, or set it down; see `ChangeContact`."""
        return self._do(ChangeContact(contact, bears, at=self._at, ramp=self._ramp))

    def force(self, contact: str, force: CommandedForce) -> Self:
        """Change the commanded force of a contact; see `ChangeForce`."""
        return self._do(ChangeForce(contact, force, at=self._at, ramp=self._ramp))

    def _do(self, change: Change) -> Self:
        self._make(change)
        return self
