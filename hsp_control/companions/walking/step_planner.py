"""The next steps: places, phases, and the end of a walk."""

from collections.abc import Callable, Mapping
from math import hypot
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import PlanError
from hsp_control.companions.walking.biped import BipedPlan
from hsp_control.companions.walking.foot import Foot
from hsp_control.companions.walking.footsteps import Footstep, Stance, Velocity, between
from hsp_control.companions.walking.legs import hip_height, leg_length
from hsp_control.companions.walking.pendulum import DcmPhase
from hsp_control.robot import RobotState

PREVIEW = 4
"""Number of steps of a plan's preview; the effect of later ones has decayed to a
thousandth."""
LAST_SHIFT = 1.5
"""The last shift of the weight, in double supports [-]."""
_NOT_BESIDE = 0.01
"""Tolerance of feet that stand beside each other [m, rad]."""
_STRETCH = 0.9
"""Share of a leg's reach that a step uses [-]."""


class Preview(NamedTuple):
    """The preview of a walk.

    Attributes:
        phases: The phases, from a shift of the weight until the robot stands.
        swings: Whether they are swings.
        velocity: That of the next step.
        target: The next footstep; None if there is none.
    """

    phases: list[DcmPhase]
    swings: list[bool]
    velocity: Velocity
    target: Footstep | None


class Next(NamedTuple):
    """The next step.

    Attributes:
        velocity: The velocity of the body.
        target: The footstep; None if the robot is to stand.
    """

    velocity: Velocity
    target: Footstep | None


class StepPlanner:
    """Plans steps from the desired velocity.

    Attributes:
        stopping: Whether the robot is to stand as soon as it can.
    """

    def __init__(self, walk: BipedPlan, stance: Stance, robot: str) -> None:
        """Set the walk and the stance."""
        self._walk, self._stance = walk, stance
        self.stopping = False
        self.period = walk.swing + walk.double_support
        speed = hypot(walk.speed, walk.sideways)
        if speed * self.period > stance.longest:
            raise PlanError(
                f"{speed:.3g} m/s with {self.period:.3g} s per step are strides of "
                f"{speed * self.period:.3g} m; the legs of {robot} reach "
                f"{stance.longest:.3g} m. Walk slower, or with a shorter swing"
            )

    def wanted(self, t: float, taken: int) -> Velocity:
        """Return the desired velocity after some steps; zero after the last one."""
        steps = self._walk.steps
        if self.stopping or (steps is not None and taken >= steps):
            return Velocity(0.0, 0.0, 0.0)
        return self._walk.velocity_at(t)

    def look_ahead(
        self,
        t: float,
        taken: int,
        velocity: Velocity,
        side: float,
        places: Mapping[float, Footstep],
        shift: float,
        point: Array,
        lead: Callable[[float, Mapping[float, Footstep], Footstep], Array],
    ) -> Preview:
        """Return the preview from a phase on two feet on."""
        walk, places = self._walk, dict(places)
        phases, swings = list[DcmPhase](), list[bool]()
        first: Next | None = None
        for k in range(PREVIEW):
            step = self._next(velocity, t, taken + k, side, places)
            velocity, target = step
            first = first or step
            if target is None:
                break
            center = places[-side].point
            beside = lead(side, places, target)
            phases += [
                DcmPhase(shift, point, center),
                DcmPhase(walk.swing, center, center, beside),
            ]
            swings += [False, True]
            places[side] = target
            side, point, shift = -side, center, walk.double_support
        assert first is not None
        middle = between(places[1.0], places[-1.0]).point
        phases += [
            DcmPhase(LAST_SHIFT * walk.double_support, point, middle),
            DcmPhase(1.0, middle, middle),
        ]
        return Preview(phases, [*swings, False, False], *first)

    def sets_out(self, t: float, taken: int) -> bool:
        """Return whether a standing robot is to walk."""
        return not self.wanted(t, taken).is_zero

    def first_side(self, t: float, taken: int) -> float:
        """Return the foot that swings first: 1 is the left one, -1 the right one."""
        wanted = self.wanted(t, taken)
        return -1.0 if wanted.left < 0.0 or wanted.turn < 0.0 else 1.0

    def _next(
        self,
        velocity: Velocity,
        t: float,
        taken: int,
        side: float,
        places: Mapping[float, Footstep],
    ) -> Next:
        """Return the next step."""
        velocity = self._next_velocity(velocity, t, taken)
        target = self._stance.next(places[-side], side, velocity, self.period)
        stands = velocity.is_zero and _beside(places[side], target)
        return Next(velocity, None if stands else target)

    def _next_velocity(self, now: Velocity, t: float, taken: int) -> Velocity:
        """Return the velocity of a step, as near to the desired one as possible."""
        wanted = self.wanted(t, taken)
        largest = self._walk.acceleration * self.period
        bounds = largest, largest, largest / max(0.5 * self._stance.width, 0.1)
        return now.towards(wanted, bounds)


def stance_of(feet: Mapping[float, Foot], state: RobotState, crouch: float) -> Stance:
    """Return the stance of a biped, and the reach of its legs."""
    left, right = feet[1.0], feet[-1.0]
    width = float(right.place.local(left.place.point)[1])
    soles = 0.5 * (left.sole_width + right.sole_width)
    narrowest = soles + 0.02
    if width < narrowest:
        raise PlanError(
            f"the feet {left.name!r} and {right.name!r} stand {width:.3g} m apart; "
            f"their soles are {soles:.3g} m wide and would meet"
        )
    squares = [
        leg_length(state.robot, each.frame) ** 2
        - (hip_height(state, each.frame) - crouch) ** 2
        for each in feet.values()
    ]
    # Both legs contribute half of the step.
    longest = 2.0 * _STRETCH * float(np.sqrt(max(min(squares), 0.0)))
    return Stance(width, narrowest, max(3.0 * width, width + 0.1), longest)


def _beside(place: Footstep, target: Footstep) -> bool:
    """Return whether a foot is at its place beside the other one."""
    away = hypot(place.x - target.x, place.y - target.y)
    return away < _NOT_BESIDE and abs(place.yaw - target.yaw) < _NOT_BESIDE
