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

    Attributes:
        sets: Each set of limits, None for none, in order of time; and its share, in
            [0, 1]. The sum of the shares is 1.
    """

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

    def at(self, t: float, robot: Robot) -> RobotLimits | None:
        """Return the limits that the mixture keeps at time t [s]: the mean numbers.

        The bounds on efforts and accelerations are linear in them. Distances are those
        of all sets that count.
        """
        counting = [(each, share.at(t)) for each, share in self.sets]
        counting = [pair for pair in counting if pair[1] > 0.0]
        if len(counting) == 1:
            return counting[0][0]
        return _mean([(each or _none(robot), share) for each, share in counting])

    def settled(self, t: float) -> "PlannedLimits":
        """Return the limits for times from t on: complete changes are folded."""
        folded = [(each, share.settled(t)) for each, share in self.sets]
        return PlannedLimits(tuple(pair for pair in folded if pair[1] != ABSENT))


def _mean(sets: Sequence[tuple[RobotLimits, float]]) -> RobotLimits:
    """Return the weighted mean of the numbers; inf where any of them is."""
    last, _ = sets[-1]

    def mean(numbers: Sequence[Array]) -> Array:
        parts = [share * each for (_, share), each in zip(sets, numbers, strict=True)]
        return np.asarray(np.sum(parts, axis=0))

    def of(name: str) -> Array:
        return mean([getattr(each, name) for each, _ in sets])

    return RobotLimits(
        robot=last.robot,
        effort=of("effort"),
        effort_rate=of("effort_rate"),
        velocity=of("velocity"),
        lower=of("lower"),
        upper=of("upper"),
        motion=MotionLimits(*map(mean, zip(*(a.motion for a, _ in sets), strict=True))),
        distances=tuple(one for each, _ in sets for one in each.distances),
    )


def _none(robot: Robot) -> RobotLimits:
    """Return limits that bound nothing."""
    endless = np.full(robot.nv, np.inf)
    motion = MotionLimits(
        -endless, endless, endless, endless, endless, np.array([10.0])
    )
    return RobotLimits(
        robot=robot,
        effort=endless,
        effort_rate=endless,
        velocity=endless,
        lower=-endless,
        upper=endless,
        motion=motion,
    )
