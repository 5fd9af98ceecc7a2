"""Contacts and limits as functions of time, and what switches contacts."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import RobotLimits
from hsp_control.constraints.limits.acceleration_bounds import MotionLimits
from hsp_control.control.evolution import ABSENT, PRESENT, Evolution
from hsp_control.robot import Robot
from hsp_control.trajectories.switch import Switch

HELD = 0.1
"""A contact whose weight is this or more is kept at rest. With 1, a foot would move
while it bears; with 0, its motion would be set free, or stopped, with a jump."""


@dataclass(frozen=True)
class PlannedContact:
    """A contact, and when it is part of the controller."""

    contact: Contact
    presence: Evolution[float]  # 1 while it bears, 0 while it is lifted
    # what a compensator adds to the commanded normal force, shape (1,) [N]; every step
    # reads this array
    force_offset: Array = field(default_factory=lambda: np.zeros(1), compare=False)

    @property
    def always(self) -> bool:
        """Whether the contact bears at all times."""
        return self.contact.always and self.presence == PRESENT

    def active(self, t: float) -> bool:
        """Return whether the contact is kept at rest at time t [s]."""
        return self.contact.active(t) and (
            self.presence == PRESENT or self.presence.at(t) > 0.0
        )

    def weight(self, t: float) -> float:
        """Return how much it bears at time t [s], in [0, 1]."""
        return self.contact.weight(t) * self.presence.at(t)

    def share(self, t: float) -> float:
        """Return how much it is kept at rest at time t [s], in [0, 1]."""
        # It is 1 - (1 - x)³ with x the weight over `HELD`: C² in time, as the weight.
        if not self.active(t):
            return 0.0
        x = min(self.weight(t) / HELD, 1.0)
        return x * (3.0 - x * (3.0 - x))

    def edge(self, t: float) -> float:
        """Return when its schedule, near t, lifts it, or lifted it last [s]."""
        schedule = self.contact.schedule
        return t if schedule is None else schedule.edge(t)


class Switched:
    """The switches of a contact and of the task that takes its place.

    Each begins where the other ends, so that the law goes over from one to the other
    while the force fades or rises; see `PlannedTask.weight_beyond`.
    """

    contact: Switch
    task: Switch | None  # that moves its link

    def reset(self) -> None:
        """Return to the state before the first switch."""
        for switch in (self.contact, self.task):
            if switch is not None:
                switch.reset()

    def unload(self, t: float, ramp: float) -> None:
        """Let the force fade from a time on [s]; then the task moves the link."""
        self.contact.throw(False, t, ramp)
        if self.task is not None:
            self.task.throw(True, t + ramp)

    def lift(self, t: float) -> None:
        """Let the task move the link now [s]."""
        self.unload(t, 0.0)

    def bear(self, t: float, ramp: float) -> None:
        """Let the force rise from now on [s], while the task ends."""
        if self.task is not None:
            self.task.throw(True, t)  # it may wait for the end of a ramp
            self.task.throw(False, t)
        self.contact.throw(True, t, ramp)

    def rests(self, t: float) -> bool:
        """Return whether the contact alone counts at time t [s], and its task ends."""
        return self.contact.is_on and self.contact.weight(t) >= HELD


@dataclass(frozen=True)
class PlannedLimits:
    """The limits of a controller: sets that follow one another.

    While one follows another, both count, and what each delivers is mixed; see
    `Mixture.deliver`. So a limit can go to infinity, or come from there.
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
        folded = [(each, share.settled(t)) for each, share in self.sets]
        return PlannedLimits(tuple(pair for pair in folded if pair[1] != ABSENT))


def mean_of(
    sets: Sequence[tuple[RobotLimits | None, float]], robot: Robot
) -> RobotLimits | None:
    """Return the limits that a mixture keeps: the weighted mean of the numbers."""
    # The bounds on efforts and accelerations are linear in them. Where one of them is
    # inf, so is the mean. Distances are those of all sets.
    if len(sets) == 1:
        return sets[0][0]
    numbers = np.sum([w * _numbers(each, robot.nv) for each, w in sets], axis=0)
    numbers.flags.writeable = False
    effort, rate, velocity, lower, upper, *motion = numbers[:-1].reshape(-1, robot.nv)
    return RobotLimits(
        robot=robot,
        effort=effort,
        effort_rate=rate,
        velocity=velocity,
        lower=lower,
        upper=upper,
        motion=MotionLimits._make((*motion, numbers[-1:])),
        distances=tuple(one for each, _ in sets if each for one in each.distances),
    )


def _numbers(limits: RobotLimits | None, nv: int) -> Array:
    """Return all numbers of limits in a row; None has numbers that bound nothing."""
    if limits is None:
        signs = 1.0, 1.0, 1.0, -1.0, 1.0, -1.0, 1.0, 1.0, 1.0, 1.0
        return np.append(np.repeat(np.inf * np.array(signs), nv), 10.0)
    x = limits
    rows = x.effort, x.effort_rate, x.velocity, x.lower, x.upper, *x.motion
    return np.asarray(np.concatenate(rows))
