"""Sets of limits that follow one another, as a function of time."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import RobotLimits
from hsp_control.constraints.limits.acceleration_bounds import MotionLimits
from hsp_control.control.evolution import ABSENT, PRESENT, Evolution
from hsp_control.robot import Robot


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
    """Return the limits that a mixture keeps: the weighted mean of the numbers.

    The bounds on efforts and accelerations are linear in them. Where one of them is
    inf, so is the mean. Distances are those of all sets.
    """
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
