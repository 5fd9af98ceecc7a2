"""Contacts that begin and end by a force or a height."""

from collections.abc import Mapping, Sequence
from dataclasses import KW_ONLY, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from hsp_control.common.arrays import Array
from hsp_control.common.errors import PlanError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.walking.contact_switch import Switch, Switched
from hsp_control.constraints.contacts import Contact
from hsp_control.control.interface import (
    Controller,
    LogChannel,
    Measurement,
    MotionPlan,
    PlanParts,
    RunningPlan,
)
from hsp_control.declaration import Part, within
from hsp_control.declaration.nested import BY_NAME
from hsp_control.declaration.quantities import (
    READ_ONLY,
    Flag,
    Name,
    NonNegative,
    Number,
    Positive,
)
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Task
from hsp_control.trajectories.schedule import Intervals, Schedule


class SensedContact(Part, error=PlanError):
    """When a contact begins, and when it ends.

    It begins when its normal force reaches ``force``, or its frame ``height``, or both
    if both are given; then its force rises. It ends when its normal force is below
    ``release`` for ``patience``, because the ground is lost, and fades over the same
    time; or at the end of an interval, and fades over ``ramp``.
    """

    yaml_key: ClassVar[str | None] = "name"

    force: Positive | None = None
    """Normal force from which it is active [N]."""
    _: KW_ONLY
    height: Number | None = None
    """Height of its frame, along its normal, at or below which it is active [m]."""
    release: NonNegative | None = None
    """Normal force below which it has lost the ground [N]; a quarter of ``force`` by
    default."""
    patience: NonNegative = 0.02
    """Time for which the force must be below ``release`` [s]."""
    ramp: Positive = 0.2
    """Time in which its force rises or fades [s]."""
    wanted: Intervals | None = None
    """Intervals in which it may be active: [start, end] [s], None for no start or no
    end; always by default."""
    starts: Flag = False
    """Whether it is active at the start, before the first measurement [-]."""
    task: str | None = None
    """Name of a task that is active while the contact is not [-]: it moves the link."""
    name: str = ""
    """Name of the contact [-]. In YAML, its key."""

    def __post_init__(self) -> None:
        """Check that a condition is given, and that the intervals are in order."""
        if self.force is None and self.height is None:
            raise PlanError("give force or height, by which it is detected")
        if self.release is not None and self.force is None:
            raise PlanError("release is a force; give force, too")
        if self.release is not None and self.release >= (self.force or 0.0):
            raise PlanError(
                f"release is {self.release:g} N; must be below force = {self.force:g} N"
            )
        with within("wanted"):
            self.schedule()

    @property
    def lets_go(self) -> float | None:
        """Normal force below which it has lost the ground [N]; None: never."""
        if self.release is not None:
            return self.release
        return None if self.force is None else 0.25 * self.force

    def schedule(self) -> Schedule:
        """Return the schedule in which it may be active."""
        if self.wanted is None:
            return Schedule.always()
        return Schedule(self.wanted, ramp=0.0)


class Sensed(MotionPlan, type="sensed"):
    """Contacts are switched by detection: measured or estimated forces, or height.

    Everything else, such as tasks and references, stays as declared. A contact rises
    and fades over its ramp, so that efforts stay continuous.
    """

    contacts: Annotated[
        dict[Name, SensedContact], Field(min_length=1), BY_NAME, READ_ONLY
    ]
    """The sensed contacts, by name; others stay as declared."""

    def parts(
        self, robot: Robot, tasks: Sequence[Task], contacts: Sequence[Contact]
    ) -> PlanParts:
        """Return the parts with switches as schedules; see `MotionPlan.parts`."""
        there = {each.name: each for each in contacts}
        known = {each.name: each for each in tasks}
        moves: dict[str, SensedContact] = {}
        for name, rule in self.contacts.items():
            with within("plan", "contacts", name):
                if name not in there:
                    raise PlanError(
                        f"there is no contact {name!r}{did_you_mean(name, there)} "
                        f"(there are {listing(there) or 'none'})"
                    )
                if there[name].schedule is not None:
                    raise PlanError(
                        "the contact has a schedule, but the plan switches it; give "
                        "only one of them"
                    )
                if rule.task is None:
                    continue
                with within("task"):
                    if rule.task not in known:
                        raise PlanError(
                            f"there is no task {rule.task!r}"
                            f"{did_you_mean(rule.task, known)} (there are "
                            f"{listing(known) or 'none'})"
                        )
                    if known[rule.task].schedule is not None or rule.task in moves:
                        raise PlanError(
                            f"{rule.task!r} has a schedule, or moves two contacts; it "
                            "must be active while the contact is not"
                        )
                moves[rule.task] = rule
        return PlanParts(
            tuple(
                replace(each, schedule=Switch(on=not moves[each.name].starts))
                if each.name in moves
                else each
                for each in tasks
            ),
            tuple(
                replace(each, schedule=Switch(on=self.contacts[each.name].starts))
                if each.name in self.contacts
                else each
                for each in contacts
            ),
        )

    def begin(self, controller: Controller) -> "RunningSensed":
        """Return the switches of a run; see `MotionPlan.begin`."""
        return RunningSensed(self, controller)


class FeltContact(Switched):
    """A contact in one run: whether it is active, and its measurements.

    Attributes:
        name: Its name.
        frame: Its frame.
        force: The normal force that is measured [N]; NaN without one.
        height: The height of its frame along the normal [m].
        estimated: Whether the force is estimated.
        events: Number of times it has begun or ended.
    """

    def __init__(self, name: str, rule: SensedContact, controller: Controller) -> None:
        """Find its switches in a controller.

        Raises:
            PlanError: If the controller is not built from the plan's parts.
        """
        self.name, self._rule = name, rule
        contact = {each.name: each for each in controller.contacts}.get(name)
        task = {each.name: each for each in controller.tasks}.get(rule.task or "")
        if (
            contact is None
            or not isinstance(contact.schedule, Switch)
            or (task is None) != (rule.task is None)
            or not (task is None or isinstance(task.schedule, Switch))
        ):
            raise PlanError(
                f"the contact {name!r} does not follow the plan: build the controller "
                "from the plan's parts"
            )
        self.frame: str = contact.frame
        self._normal: Array = contact.axes[:, 2]
        self.contact = contact.schedule
        switch = None if task is None else task.schedule
        self.task = switch if isinstance(switch, Switch) else None
        self._wanted = rule.schedule()
        self.force, self.height, self.estimated = np.nan, np.nan, False
        self.events = 0

    def start(self) -> None:
        """Return to the start, before the first measurement."""
        self.reset()
        self._pressed = -np.inf  # nothing sensed yet
        self._leaving = False
        self.events = 0

    @property
    def active(self) -> bool:
        """Whether the contact is switched on."""
        return self.contact.is_on

    def update(self, t: float, state: RobotState, measured: Measurement) -> None:
        """Measure the contact, and switch it.

        Raises:
            PlanError: If a force is needed, and there is none.
        """
        rule = self._rule
        force = measured.normal_force(self.frame, self._normal)
        if force is None and rule.force is not None:
            raise PlanError(
                f"plan.contacts.{self.name}.force: nothing measures or estimates the "
                f"force at {self.frame!r}; give height instead, or a contact_observer"
            )
        self.force = np.nan if force is None else force
        self.estimated = self.frame in measured.estimated
        self.height = float(self._normal @ state.position(self.frame))
        wanted = self._wanted.active(t)
        if not self.active:
            if not self.contact.active(t) and self._leaving:
                self._leaving = False  # its force has faded
                self.events += 1
            if wanted and self._is_sensed():
                self._begin(t)
        elif not wanted:
            self._leave(t, rule.ramp)
        elif self._is_lost(t):
            self._leave(t, rule.patience)

    def _is_sensed(self) -> bool:
        rule = self._rule
        pressed = rule.force is None or self.force >= rule.force
        return pressed and (rule.height is None or self.height <= rule.height)

    def _is_lost(self, t: float) -> bool:
        limit = self._rule.lets_go
        if limit is None or self.force >= limit or self._pressed == -np.inf:
            self._pressed = t
        return t - self._pressed > self._rule.patience

    def _begin(self, t: float) -> None:
        self._pressed, self._leaving = t, False
        self.set_down(t, self._rule.ramp)
        self.events += 1

    def _leave(self, t: float, ramp: float) -> None:
        self._leaving = True
        self.unload(t, ramp)


class RunningSensed(RunningPlan):
    """A `Sensed` in one run."""

    def __init__(self, sensed: Sensed, controller: Controller) -> None:
        """Find the switches.

        Raises:
            PlanError: If the controller is built from other parts.
        """
        super().__init__(sensed)
        self._controller = controller
        self._state = RobotState(controller.robot)
        self._sensed = [
            FeltContact(name, rule, controller)
            for name, rule in sensed.contacts.items()
        ]
        self._begun = False

    def start(self, state: RobotState) -> None:
        """Begin before the first measurement; see `RunningPlan.start`."""
        for each in self._sensed:
            each.start()
        self._begun = True

    def update(self, measured: Measurement) -> None:
        """Switch contacts; see `RunningPlan.update`."""
        state = self._state.update(measured.t, measured.q, measured.v)
        if not self._begun:
            self.start(state)
        for each in self._sensed:
            each.update(measured.t, state, measured)

    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return the contacts' measurements, and whether they are active."""
        channels: dict[str, LogChannel] = {}
        for each in self._sensed:
            prefix = f"plan.{each.name}"
            channels |= {
                f"{prefix}.active": LogChannel(
                    float(each.active), "-", "whether it is switched on"
                ),
                f"{prefix}.events": LogChannel(
                    float(each.events), "-", "how often it has begun or ended"
                ),
                f"{prefix}.force": LogChannel(
                    each.force, "N", "normal force as measured or estimated"
                ),
                f"{prefix}.estimated": LogChannel(
                    float(each.estimated), "-", "1 if the force is estimated"
                ),
                f"{prefix}.height": LogChannel(
                    each.height, "m", "of its frame, along the normal"
                ),
            }
        return channels
