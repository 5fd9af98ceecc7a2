"""Contacts that begin and end when that is felt: what YAML and Python say."""

from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from typing import Annotated, ClassVar

from pydantic import Field

from hsp_control.common.exceptions import PlanError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.constraints.contacts import Contact
from hsp_control.control.controller import Controller
from hsp_control.declaration import Part, within
from hsp_control.declaration.named import BY_NAME
from hsp_control.declaration.quantities import (
    READ_ONLY,
    Flag,
    Name,
    NonNegative,
    Number,
    Positive,
)
from hsp_control.plans.plan import Plan, PlanParts
from hsp_control.plans.sensing import RunningSensed
from hsp_control.robot import Robot
from hsp_control.tasks import Task
from hsp_control.trajectories.schedule import Intervals, Schedule
from hsp_control.trajectories.switch import Switch


class SensedContact(Part, error=PlanError):
    """When a contact begins to bear, and when it ends.

    It begins when it is pressed with ``force``, or is at ``height``, or both if both
    are given; then its force rises. It ends when it is pressed with less than
    ``release`` for ``patience``, because the ground is gone, and fades as long again;
    or when it is not wanted any more, and fades over ``ramp``.
    """

    yaml_key: ClassVar[str | None] = "name"

    force: Positive | None = None
    """Normal force from which it bears [N]."""
    _: KW_ONLY
    height: Number | None = None
    """Height of its frame, along its normal, at or below which it bears [m]."""
    release: NonNegative | None = None
    """Normal force below which it has lost the ground [N]; a quarter of ``force`` by
    default."""
    patience: NonNegative = 0.02
    """For how long the force must be below ``release`` [s]."""
    ramp: Positive = 0.2
    """How long its force takes to rise, and to fade [s]."""
    wanted: Intervals | None = None
    """Intervals in which it may bear: [start, end] [s], None for no start or no end;
    always by default."""
    starts: Flag = False
    """Whether it bears at the start, before anything is felt [-]."""
    task: str | None = None
    """Name of a task that counts while it does not bear [-]: what moves its link."""
    name: str = ""
    """Name of the contact [-]. In YAML, its key."""

    def __post_init__(self) -> None:
        """Check that something is sensed, and that the intervals follow one another."""
        if self.force is None and self.height is None:
            raise PlanError("give force or height: what tells that it bears")
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
        """Normal force below which it has lost the ground [N]; None: it never does."""
        if self.release is not None:
            return self.release
        return None if self.force is None else 0.25 * self.force

    def schedule(self) -> Schedule:
        """Return when it may bear."""
        if self.wanted is None:
            return Schedule.always()
        return Schedule(self.wanted, ramp=0.0)


class Sensed(Plan, type="sensed"):
    """Contacts are switched by what is felt: measured or estimated forces, or height.

    Everything else, tasks and their references, is as it is declared. A contact rises
    and fades over its ramp, so that efforts stay continuous.
    """

    contacts: Annotated[
        dict[Name, SensedContact], Field(min_length=1), BY_NAME, READ_ONLY
    ]
    """The contacts that are sensed, by name; others are as they are declared."""

    def parts(
        self, robot: Robot, tasks: Sequence[Task], contacts: Sequence[Contact]
    ) -> PlanParts:
        """Return the parts with switches as schedules; see `Plan.parts`."""
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
                        "only one, or the intervals as wanted"
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
                            "counts while the contact does not bear"
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

    def begin(self, controller: Controller) -> RunningSensed:
        """Return what switches; see `Plan.begin`."""
        return RunningSensed(self, controller)
