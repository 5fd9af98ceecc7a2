"""Limits that change smoothly, as a function of time."""

from dataclasses import dataclass, replace

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import MinimumDistance, RobotLimits, StaticEffort
from hsp_control.constraints.limits.acceleration_bounds import MotionLimits
from hsp_control.control.evolution import ABSENT, PRESENT, Evolution
from hsp_control.robot import Robot

_SLACK = 1.0
"""A distance that fades has this much slack where it counts half [m/s²]."""


@dataclass(frozen=True)
class PlannedLimits:
    """The limits of a controller, from one set of numbers to the next.

    Numbers change through x/(1 + |x|), which is finite where there is no limit, so that
    a limit comes from infinity, and goes there. Distances fade by a slack that grows
    to infinity.

    Attributes:
        sets: All sets of limits, in order of time; None for none.
        numbers: The numbers of the set in force, encoded.
        distances: All minimum distances, and how much each counts, in [0, 1].
    """

    sets: tuple[RobotLimits | None, ...]
    numbers: Evolution[Array]
    distances: tuple[tuple[MinimumDistance, Evolution[float]], ...]

    @classmethod
    def of(cls, limits: RobotLimits | None, robot: Robot) -> "PlannedLimits":
        """Return limits that do not change."""
        distances = () if limits is None else limits.distances
        return cls(
            (limits,),
            Evolution(_encoded(limits, robot)),
            tuple((each, PRESENT) for each in distances),
        )

    @property
    def end(self) -> float:
        """When the last change is complete [s]; -inf without changes."""
        return max(
            self.numbers.end, *(count.end for _, count in self.distances), -np.inf
        )

    def then(
        self, start: float, ramp: float, limits: RobotLimits | None, robot: Robot
    ) -> "PlannedLimits":
        """Return the limits with a change to other ones."""
        new = () if limits is None else limits.distances
        counts = [
            (each, count.then(start, ramp, float(each in new)))
            for each, count in self.distances
        ]
        known = [each for each, _ in self.distances]
        counts += [
            (each, ABSENT.then(start, ramp, 1.0)) for each in new if each not in known
        ]
        numbers = self.numbers.then(start, ramp, _encoded(limits, robot))
        return PlannedLimits((*self.sets, limits), numbers, tuple(counts))

    def at(self, t: float, robot: Robot) -> RobotLimits | None:
        """Return the numbers in force at time t [s], without the distances."""
        if self.numbers.constant:
            return self.sets[-1]
        return _decoded(self.numbers.at(t), robot)

    def slacks(self, t: float) -> list[tuple[MinimumDistance, float]]:
        """Return the distances that count at time t [s], with their slacks [m/s²]."""
        found = []
        for each, count in self.distances:
            a = count.at(t)
            if a > 0.0:
                found.append((each, _SLACK * (1.0 - a) / a))
        return found

    def settled(self, t: float) -> "PlannedLimits":
        """Return the limits for times from t on: complete changes are folded."""
        numbers = self.numbers.settled(t)
        counts = [(each, count.settled(t)) for each, count in self.distances]
        return replace(
            self,
            sets=self.sets[-1 - len(numbers.transitions) :],
            numbers=numbers,
            distances=tuple(pair for pair in counts if pair[1] != ABSENT),
        )


def _encoded(limits: RobotLimits | None, robot: Robot) -> Array:
    """Return the numbers of limits as one array of finite numbers."""
    nv = robot.nv
    endless = np.full(nv, np.inf)
    if limits is None:
        rows = [endless] * 3 + [-endless, endless] * 2 + [endless] * 3
        bandwidth, share = 10.0, np.inf
    else:
        motion = limits.motion
        rows = [
            limits.effort,
            limits.effort_rate,
            limits.velocity,
            limits.lower,
            limits.upper,
            motion.lower,
            motion.upper,
            motion.velocity,
            motion.acceleration,
            motion.jerk,
        ]
        bandwidth = limits.bandwidth
        static = limits.static_effort
        share = np.inf if static is None else static.share
    x = np.concatenate([*rows, [bandwidth, share]])
    finite = np.isfinite(x)
    shrunk = np.where(finite, x, 0.0) / (1.0 + np.abs(x))
    return np.asarray(np.where(finite, shrunk, np.sign(x)))


def _decoded(code: Array, robot: Robot) -> RobotLimits:
    inside = np.abs(code) < 1.0
    safe = np.where(inside, code, 0.0)
    x = np.where(inside, safe / (1.0 - np.abs(safe)), np.sign(code) * np.inf)
    rows, (bandwidth, share) = x[:-2].reshape(10, robot.nv), x[-2:]
    effort = rows[0]
    return RobotLimits(
        robot=robot,
        effort=effort,
        effort_rate=rows[1],
        velocity=rows[2],
        lower=rows[3],
        upper=rows[4],
        motion=MotionLimits(
            rows[5], rows[6], rows[7], rows[8], rows[9], np.array([bandwidth])
        ),
        static_effort=StaticEffort(effort, share) if np.isfinite(share) else None,
    )
