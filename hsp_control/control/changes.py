"""Changes of a controller while it runs: events on one time line."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from itertools import takewhile
from numbers import Real
from typing import TYPE_CHECKING, Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.entry_points import own_names
from hsp_control.common.errors import ControllerError, GainError, HspControlError
from hsp_control.common.keywords import suggesting_methods
from hsp_control.common.suggestions import did_you_mean
from hsp_control.constraints.contacts import CommandedForce
from hsp_control.constraints.limits import Limits
from hsp_control.control.change import (
    AddTask,
    Change,
    ChangeContact,
    ChangeField,
    ChangeForce,
    ChangeGains,
    ChangeImpedance,
    ChangeLimits,
    ChangeNullSpaceGain,
    ChangeReference,
    ChangeWeight,
    ExchangeField,
    MoveObstacle,
    RemoveTask,
)
from hsp_control.control.change_model import ChangeGravity, ChangePayload, ChangeTool
from hsp_control.control.fitting import check_limits, checked_gain
from hsp_control.control.setup import Setup
from hsp_control.declaration import within
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.quantities import Gain
from hsp_control.declaration.rotation import AnyRotation
from hsp_control.geometry.scene import Start
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.tasks import Gains, Impedance, Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.gains import check_decay
from hsp_control.trajectories import Trajectory
from hsp_control.trajectories.crossfade import AnyReference
from hsp_control.trajectories.pose import AnyPose
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.streams.run import StreamRun

__all__ = [
    "AddTask",
    "Change",
    "ChangeContact",
    "ChangeField",
    "ChangeForce",
    "ChangeGains",
    "ChangeGravity",
    "ChangeImpedance",
    "ChangeLimits",
    "ChangeNullSpaceGain",
    "ChangePayload",
    "ChangeReference",
    "ChangeTool",
    "ChangeWeight",
    "Changes",
    "ExchangeField",
    "MoveObstacle",
    "RemoveTask",
]


@suggesting_methods
class Changes:
    """Makes changes that begin at one time: the result of `Controller.at`.

    A method makes one change and returns the object, so that calls can be chained::

        controller.at(1.0).ramp(0.5).gains("hand", stiffer).remove("posture")
    """

    def __init__(
        self, make: Callable[[Change], object], at: float, ramp: float = 0.3
    ) -> None:
        """Set when the changes begin, and how long they take [s]."""
        for name, value in (("at", at), ("ramp", ramp)):
            if not isinstance(value, Real):
                raise ControllerError(f"{name} is {value!r}; needs a number [s]")
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

    def reference(
        self, task: str, trajectory: AnyReference | AnyRotation | AnyPose
    ) -> Self:
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

    def obstacle(self, obstacle: str, center: Trajectory | ArrayLike) -> Self:
        """Move an obstacle on another trajectory; see `MoveObstacle`."""
        return self._do(MoveObstacle(obstacle, center, at=self._at, ramp=self._ramp))

    def limits(self, limits: Limits | None) -> Self:
        """Change the limits; see `ChangeLimits`."""
        check_limits(limits)
        return self._do(ChangeLimits(limits, at=self._at, ramp=self._ramp))

    def contact(self, contact: str, *, active: bool) -> Self:
        """Lift a contact, or set it down; see `ChangeContact`."""
        return self._do(ChangeContact(contact, active, at=self._at, ramp=self._ramp))

    def force(self, contact: str, force: CommandedForce) -> Self:
        """Change the commanded force of a contact; see `ChangeForce`."""
        return self._do(ChangeForce(contact, force, at=self._at, ramp=self._ramp))

    def payload(
        self,
        frame: str,
        mass: float,
        center: ArrayLike = (0.0, 0.0, 0.0),
        inertia: ArrayLike = 0.0,
    ) -> Self:
        """Take up a payload at a frame, or put it down, mass=0; see `ChangePayload`."""
        at, ramp = self._at, self._ramp
        return self._do(ChangePayload(frame, mass, center, inertia, at=at, ramp=ramp))

    def tool(
        self,
        frame: str,
        position: ArrayLike = (0.0, 0.0, 0.0),
        rotation: ArrayLike = (0.0, 0.0, 0.0),
    ) -> Self:
        """Move a frame to a tool's tip, or back to the model's; see `ChangeTool`."""
        at, ramp = self._at, self._ramp
        return self._do(ChangeTool(frame, position, rotation, at=at, ramp=ramp))

    def gravity(self, gravity: ArrayLike) -> Self:
        """Change gravity in the world [m/s²]; see `ChangeGravity`."""
        return self._do(ChangeGravity(gravity, at=self._at, ramp=self._ramp))

    if not TYPE_CHECKING:

        def __getattr__(self, name: str) -> None:
            """Raise for an unknown kind of change."""
            known = [each for each in vars(type(self)) if not each.startswith("_")]
            raise AttributeError(
                f"at(t) has no {name!r}{did_you_mean(name, known)}; a change of a "
                "class of your own is made by controller.change(...)"
            )

    def _do(self, change: Change) -> Self:
        self._make(change)
        return self


@dataclass(frozen=True)
class TimeLine:
    """The setup in force at every time."""

    start: Start  # the start at which parts were placed
    declared: tuple[Change, ...]  # changes of every run, as given
    settled: Setup  # setup with all changes that are over
    open: tuple[Change, ...]  # changes that are not over, placed, in order of time
    made: tuple[Change, ...] = ()  # those of `open` that were made during the run
    count: int = 0  # their number

    @classmethod
    def of(cls, setup: Setup, made: Sequence[Change]) -> "TimeLine":
        """Place changes in a setup."""
        # In order of time: a change may refer to the result of an earlier one.
        given, later, placed = [*made], setup, []
        for k in sorted(range(len(made)), key=lambda k: made[k].at):
            with within("changes", k):
                given[k] = given[k].understood(later)
                placed.append(given[k].placed(setup.start, later))
                later = _checked(placed[-1], later)
        return cls(setup.start, tuple(given), setup, tuple(placed))

    @property
    def known(self) -> tuple[Change, ...]:
        """Changes of every run, and those made during this one that are not over."""
        return tuple(sorted((*self.declared, *self.made), key=lambda each: each.at))

    def streams(self) -> Iterator[StreamRun]:
        """Yield the streams that are in use, now or later, once."""
        setup = self.setup
        tasks = [each.task for each in setup.tasks]
        fields = [each.field for each in setup.terms]
        parts = [*tasks, *fields, setup.start.scene, *self.open]
        runs = {id(e.run): e.run for e in parts_within(parts, FollowedStream)}
        yield from runs.values()

    @cached_property
    def setup(self) -> Setup:
        """The setup with all changes."""
        return _applied(self.open, self.settled)

    def begun(self, t: float) -> Setup:
        """Return the setup with the changes that have begun at a time [s]."""
        begun = [each for each in self.open if each.at <= t]
        everything = len(begun) == len(self.open)
        return self.setup if everything else _applied(begun, self.settled)

    def with_change(self, change: Change, here: Start | None) -> "TimeLine":
        """Return the time line with one more change."""
        earlier = [each for each in self.open if each.at <= change.at]
        before = _applied(earlier, self.settled)
        change = change.understood(before)
        placed = change.placed(here or self.start, before)
        after = _checked(placed, before)
        for later in (each for each in self.open if each.at > change.at):
            try:
                after = later.apply(after)
            except HspControlError as error:
                raise ControllerError(
                    f"the {type(later).__name__} at t = {later.at:g} s would not fit "
                    f"any more: {error.bare_message}"
                ) from None
        opened = sorted((*self.open, placed), key=lambda each: each.at)
        if here is None:
            declared = (*self.declared, change)
            return replace(self, declared=declared, open=tuple(opened))
        made, count = (*self.made, placed), self.count + 1
        return replace(self, made=made, count=count, open=tuple(opened))

    def settled_at(self, t: float) -> "TimeLine":
        """Return the time line for times from t [s] on, without completed changes."""
        done = list(takewhile(lambda each: each.end <= t, self.open))
        over = len(done) == len(self.open)
        settled = (self.setup if over else _applied(done, self.settled)).settled(t)
        gone = {id(each) for each in done}
        made = tuple(each for each in self.made if id(each) not in gone)
        opened = self.open[len(done) :]
        return replace(self, settled=settled, open=opened, made=made)


def _checked(change: Change, setup: Setup) -> Setup:
    """Return a setup with a change, whose `apply` may be the user's own."""
    name, after = f"{type(change).__name__}.apply", change.apply(setup)
    if not isinstance(after, Setup):
        raise ControllerError(
            f"{name} returns {type(after).__name__}; needs the changed Setup: "
            "return replace(setup, ...)"
        )
    if after.metric is not setup.metric:
        raise ControllerError(
            f"{name} replaces the metric, which has no ramp: build another controller"
        )
    for slot in fields(setup):
        old, new = getattr(setup, slot.name), getattr(after, slot.name)
        if type(new) is not type(old):
            raise ControllerError(
                f"{name} replaces {slot.name} by {type(new).__name__}; needs "
                f"{type(old).__name__}, such as what `then` returns"
            )
    if after.gain is not setup.gain:
        checked_gain(after.gain.target, after.start.state.robot, after.metric)
    before = {id(task.gains) for task in setup.tasks}
    for task in after.tasks:
        found, needed = np.shape(task.gains.target), np.shape(task.gains.initial)
        if found != needed:
            raise ControllerError(
                f"{name} changes the gains of task {task.task.name!r} to an array of "
                f"shape {found}; needs {needed}, that of Task.in_force().numbers"
            )
        if id(task.gains) in before:
            continue
        target, of = task.gains.target, f"{name}, task {task.task.name!r}"
        if not np.isfinite(target).all():
            raise GainError(f"{of}: the gains contain NaN or inf")
        if impedance_of(task.task) is None:
            try:
                check_decay(*target)
            except GainError as error:
                raise GainError(f"{of}: {error.bare_message}") from None
    return after


def _applied(changes: Iterable[Change], setup: Setup) -> Setup:
    for change in changes:
        setup = change.apply(setup)
    return setup


__dir__ = own_names(__name__)
